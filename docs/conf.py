"""Sphinx: how these pages become a site. `make docs` builds it, with warnings as errors."""

import re

from docutils import nodes
from latex2mathml.converter import convert

import kickdyn

project = "kickdyn"
author = "the kickdyn team"
copyright = "the kickdyn team, BSD-3-Clause"
version = release = kickdyn.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_math_renderer = "mathml"
html_title = f"kickdyn {version}"
html_static_path = ["equations.css"]
html_css_files = ["equations.css"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # signatures keep to names; shapes and units are in the text
autodoc_class_signature = "separated"
napoleon_use_ivar = True
default_role = "code"


def _escape(app, what, name, obj, options, lines):
    """Docstrings are plain text: bars are absolute values, stars are powers."""
    for number, given in enumerate(lines):
        line = re.sub(r"^ *\w+(, \w+)+: ", lambda names: names[0].replace(", ", "/"), given)
        parts = re.split(r"(`[^`]*`)", line)
        parts[::2] = [re.sub(r"(?<!\\)([|*])", r"\\\1", part) for part in parts[::2]]
        lines[number] = re.sub(r"`(?=s\b)", r"`\\ ", "".join(parts))


def _inline(translator, node):
    """Write an equation as MathML, which browsers draw themselves: no script, no network."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(translator, node):
    """Write equations on lines of their own, their numbers behind them."""
    tex = re.sub(r"\\tag\{(.*?)\}", r"\\qquad \\text{(\1)}", node.astext())
    translator.body.append(f'<div class="math">{convert(tex, display="block")}</div>')
    raise nodes.SkipNode


def setup(app):
    """Hook in."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("autodoc-process-docstring", _escape, priority=400)  # before napoleon
