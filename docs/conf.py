"""Sphinx configuration of the site. `make docs` builds it, with warnings as errors."""

import re
import sys
from pathlib import Path
from typing import Generic, TypeVar

import numpy.typing
from docutils import nodes
from latex2mathml.converter import convert

import kickdyn

Scalar = TypeVar("Scalar")


class ArrayLike:
    """Stands for numpy's union of all that becomes an array, which fills lines in a signature."""


class NDArray(Generic[Scalar]):
    """Stands for numpy's alias, which signatures would show as `ndarray[tuple[Any, ...], ...]`."""


# The modules of kickdyn are not loaded yet: `import kickdyn` loads a module when a name is used.
numpy.typing.ArrayLike, numpy.typing.NDArray = ArrayLike, NDArray

sys.path.insert(0, str(Path(__file__).parent))
import reference_tables  # noqa: E402  # loads modules of kickdyn

project = "kickdyn"
author = "The kickdyn authors"
copyright = "2026, the kickdyn authors, BSD-3-Clause"
version = release = kickdyn.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_math_renderer = "mathml"
html_title = f"kickdyn {version}"
html_static_path = ["equations.css"]
html_css_files = ["equations.css"]

smartquotes = False  # it takes the two hyphens of an option for a dash

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_timeout = 3600
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "signature"  # shapes and units are in the text
autodoc_typehints_format = "short"
autodoc_class_signature = "separated"
napoleon_use_ivar = True
default_role = "code"


_KEPT = r"`[^`]*`|^(?P<indent> *)\.\. math::.*(?:\n(?:[ \t]*$|(?P=indent) +.*))*"
"""Inline code, inline formulas and blocks of formulas."""


def _escape(app, what, name, obj, options, lines):
    """Escape bars and stars of docstrings, which are absolute values and powers, not markup."""
    text = re.sub(r"(?m)^ *\w+(, \w+)+: ", lambda m: m[0].replace(", ", "/"), "\n".join(lines))
    pattern = rf"(?P<kept>{_KEPT})|(?<!\\)[|*]"
    text = re.sub(pattern, lambda m: m[0] if m["kept"] else f"\\{m[0]}", text, flags=re.MULTILINE)
    lines[:] = re.sub(r"`(?=s\b)", r"`\\ ", text).split("\n")


def _inline(translator, node):
    """Write an equation as MathML, which browsers render without scripts and network."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(translator, node):
    """Write an equation on a line of its own, followed by its number."""
    tex = re.sub(r"\\tag\{(.*?)\}", r"\\qquad \\text{(\1)}", node.astext())
    translator.body.append(f'<div class="math">{convert(tex, display="block")}</div>')
    raise nodes.SkipNode


def _dash(app, doctree):
    """Write a dash between a parameter and its description, where Sphinx leaves two hyphens."""
    for text in list(doctree.findall(nodes.Text)):
        if text == " -- ":
            text.parent.replace(text, nodes.Text(" \N{EN DASH} "))


def _tables(app, page, source):
    """Insert what a page has from the code, in every build anew."""
    text = reference_tables.with_tables(page, source[0])
    if text != source[0]:
        source[0] = text
        app.env.note_reread()


def setup(app):
    """Register the math renderer, the escaping of docstrings, and what changes pages."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("autodoc-process-docstring", _escape, priority=400)  # before napoleon
    app.connect("doctree-read", _dash)
    app.connect("source-read", _tables)
