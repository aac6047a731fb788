"""Any answer of kickdyn as plain values: what JSON can hold, rounded, without names of this machine."""

import base64
import dataclasses
import enum
import math
import re
import tempfile
from collections.abc import Mapping, Set
from functools import cached_property

import numpy as np
import pinocchio as pin

from kickdyn.core.representation import ReprMixin
from kickdyn.errors import KickdynError

DIGITS = 9
LONGEST = 12
"""Entries of an array that are stored one by one; of a longer one, sums are."""
DEEPEST = 3
"""How many objects inside of each other are shown; below, their printed form."""
SKIPPED = {
    "leg_response", "constraint_projector", "slopes", "workspace", "file", "model", "evaluations",
    "iterations", "history", "viewer", "scenes", "approach", "tracks", "track", "meetings",
    "articulated_bodies", "seconds", "digits", "joint_digits", "rounding",
}  # fmt: skip
"""Attributes that are of no use to others, or depend on the machine."""
TIMES = {"seconds", "took", "evaluations", "model_sha256", "front"}
"""Keys of what depends on the machine: times, rounding, and which of equal postures is counted."""
BRIEF = {"Ball", "Air", "Contact", "Ground", "Plane", "Surface", "Posture", "Goal", "BallState"}
"""Types that are shown by their printed form inside of others."""
EXPENSIVE = {"html", "others", "margins", "meetings"}


def plain(value, depth=0):
    """Return a value as JSON has it."""
    if value is None or isinstance(value, bool | np.bool_):
        return None if value is None else bool(value)
    if isinstance(value, enum.Enum):
        return plain(value.value)
    if isinstance(value, str):
        return text_of(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return number(float(value))
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if isinstance(value, np.ndarray):
        return array(value, depth)
    special = _SPECIAL.get(type(value).__name__)
    if special is not None:
        return special(value, depth)
    if isinstance(value, Mapping):
        items = ((str(plain(key)), item) for key, item in value.items())
        return {key: plain(item, depth) for key, item in items if key not in TIMES}
    if isinstance(value, pin.SE3):
        return array(value.homogeneous)
    if isinstance(value, Exception):
        return message(value)
    if isinstance(value, Set):
        return sorted(map(str, value))
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {name: plain(item, depth) for name, item in zip(value._fields, value, strict=True)}
    if isinstance(value, list | tuple):
        return sequence(value, depth)
    if type(value).__module__.startswith("kickdyn."):
        if isinstance(value, type) or (callable(value) and not dataclasses.is_dataclass(value)):
            return name_of(value)
        return attributes(value, depth)
    if callable(value):
        return name_of(value)
    return f"<{type(value).__name__}>"


def number(value):
    """Return a number rounded, as text where it is not finite."""
    if not math.isfinite(value):
        return f"<{value}>"
    return float(f"{value:.{DIGITS}g}")


def name_of(function):
    """Return the name of a function or class."""
    inner = getattr(function, "func", function)
    return f"<{getattr(inner, '__qualname__', type(inner).__name__)}>"


def text_of(text):
    """Return a text without what is of this machine or run."""
    text = re.sub(r"0x[0-9a-f]{6,}", "0x", text)
    text = re.sub(r"\d+ evaluations", "N evaluations", text)
    text = re.sub(r"(answer took|seconds=) ?[-+.\de]+", r"\1 T", text)
    text = re.sub(r"((?:pin|numpy|scipy) )\d[\w.]+", r"\1N", text)
    text = re.sub(r"condition [1-9]e\+1[5-9]", "condition N", text)  # of rounding
    text = re.sub(r"(iterations(?:</th><td[^>]*>| +))\d+", r"\1N", text)
    text = re.sub(r"/[\w./-]*/(site-packages|urdf|scenes|data)/", r"\1/", text)
    return re.sub(re.escape(tempfile.gettempdir()) + r"/\w+", "TMP", text)


def message(error):
    """Return the kind and the text of an error."""
    return f"{type(error).__name__}: {text_of(str(error))}"


def sequence(items, depth=0):
    """Return a list; of a long one its length, and its beginning and end."""
    items = list(items)
    try:
        numbers = np.array(items, dtype=float) if items and not isinstance(items[0], str) else None
    except (TypeError, ValueError):
        numbers = None
    if numbers is not None and numbers.size > LONGEST:
        return array(numbers)
    if len(items) > 3 * LONGEST:
        shown = [plain(item, depth) for item in [*items[:LONGEST], *items[-LONGEST:]]]
        return {"length": len(items), "ends": shown}
    return [plain(item, depth) for item in items]


def array(values, depth=0):
    """Return an array; of a long one its shape and four sums, with weights that tell entries apart."""
    values = np.asarray(values)
    if values.dtype.kind in "OUS":
        return sequence(values.ravel().tolist(), depth)
    if values.dtype.kind in "mM":
        return text_of(str(values))
    if values.dtype.kind == "b":
        values = values.astype(int)
    if values.dtype.names:
        return {name: array(values[name]) for name in values.dtype.names}
    if values.size <= LONGEST:
        return _rounded(values.tolist())
    flat = values.astype(float).ravel()
    finite = np.where(np.abs(flat) < 1e100, flat, 0.0)  # of limits, the largest float is none
    places = np.arange(flat.size)
    weights = np.array([np.ones(flat.size), *(np.cos(k * places + k) for k in (1.0, 2.7, 0.01))])
    size = math.sqrt(float(finite @ finite) / flat.size)
    shown = {
        "shape": list(values.shape),
        "sums": [number(size)] + [number(x) for x in (weights @ finite / flat.size).tolist()],
    }
    odd = int(np.count_nonzero(~(np.abs(flat) < 1e100)))
    return shown | {"not finite": odd} if odd else shown


def _rounded(values):
    if isinstance(values, list):
        return [_rounded(value) for value in values]
    return number(values) if isinstance(values, float) else values


def printed(value):
    """Return what a terminal shows; of a dataclass with arrays that prints all digits, its name."""
    text = repr(value)
    return type(value).__name__ if "array(" in text or " at 0x" in text else text_of(text)


def attributes(value, depth=0):
    """Return what an object of kickdyn says of itself: its printed form and public attributes."""
    kind = type(value)
    shown = {"type": kind.__name__}
    if depth and kind.__name__ in BRIEF:
        return text_of(repr(value))
    if depth >= DEEPEST:
        return shown | {"printed": printed(value)}
    if "__repr__" in vars(kind) or isinstance(value, ReprMixin):
        shown["printed"] = printed(value)
    if kind.__str__ is not object.__str__ and str(value) != repr(value):
        shown["str"] = text_of(str(value))
    names = (
        [field.name for field in dataclasses.fields(value)]
        if dataclasses.is_dataclass(value)
        else []
    )
    names += (
        [name for name in vars(value) if name not in names] if hasattr(value, "__dict__") else []
    )
    for base in kind.__mro__:
        names += [
            name
            for name, item in vars(base).items()
            if isinstance(item, property | cached_property) and name not in names
        ]
    for name in sorted(names):
        if name.startswith("_") or name in SKIPPED or (depth and name in EXPENSIVE):
            continue
        try:
            item = getattr(value, name)
        except (KickdynError, AttributeError, ValueError) as error:
            shown[name] = message(error)
            continue
        shown[name] = plain(item, depth + 1)
    return shown


def of_leg(leg, depth=0):
    """Return a leg: as an attribute its name, else its numbers."""
    if depth:
        return text_of(f"{leg.name}, {leg.frame}")
    model = leg.model
    q = leg.configuration()
    return {
        "printed": text_of(repr(leg)),
        "warnings": plain(leg.warnings),
        "joints": list(leg.joint_names),
        "single": list(leg.single_joints),
        "parents": list(model.parents),
        "placements": array(np.array([place.homogeneous for place in model.jointPlacements])),
        "inertias": array(np.array([body.toDynamicParameters() for body in model.inertias])),
        "frames": [frame.name for frame in model.frames],
        "frame placements": array(np.array([f.placement.homogeneous for f in model.frames])),
        "armature": array(model.armature),
        "limits": [array(x) for x in (leg.lower, leg.upper, leg.velocity_limit, leg.effort_limit)],
        "neutral": array(q),
        "values": plain(leg.joint_values(q)),
        "degrees": plain(leg.angles_deg(q)),
        "metres": plain(leg.positions_m(q)),
        "units": [leg.joint_unit(name) for name in leg.single_joints],
        "mimics": plain(leg.mimics, 1),
        "supports": plain(leg.supports, 1),
        "loops": plain(leg.loops, 1),
        "open loops": plain(leg.open_loops, 1),
        "drives": plain(dict(leg.drives), 1),
        "stiff": plain(leg.stiff_joints),
        "base velocity": plain(leg.base_velocity),
        "normal cone": plain(leg.contact_normal_cone),
        "contact": [int(leg.contact_joint), plain(leg.contact_lever)],
        "outside": plain(
            leg.outside_range(q + 9.0) if leg.nq == leg.nv and not leg.mimics else None
        ),
        "too fast": plain(leg.too_fast(np.full(leg.nv, 40.0))),
    }


def of_dataset(data, depth=0):
    """Return an xarray dataset with its attributes and units."""
    return {
        "sizes": dict(data.sizes),
        "attributes": {
            k: plain(v)
            for k, v in data.attrs.items()
            if k not in ("history", "kickdyn_version", "model_sha256")
        },
        **{
            str(name): {"dimensions": list(item.dims), "attributes": plain(dict(item.attrs))}
            | {"type": item.dtype.kind, "values": array(item.values)}
            for name, item in data.variables.items()
        },
    }


def of_figure(figure, depth=0):
    """Return what is drawn and written in a figure, in coordinates of the data."""
    figure.draw_without_rendering()
    return {
        "size": array(figure.get_size_inches()),
        "texts": [text.get_text() for text in figure.texts],
        "suptitle": figure.get_suptitle() if hasattr(figure, "get_suptitle") else "",
        "legends": [_legend(legend) for legend in figure.legends],
        "axes": [_axes(axes) for axes in figure.axes],
    }


def _legend(legend):
    return None if legend is None else [text.get_text() for text in legend.get_texts()]


def _axes(axes):
    shown = {
        "titles": [axes.get_title(loc) for loc in ("left", "center", "right")],
        "labels": [axes.get_xlabel(), axes.get_ylabel()],
        "scales": [axes.get_xscale(), axes.get_yscale(), str(axes.get_aspect())],
        "limits": array(np.array([axes.get_xlim(), axes.get_ylim()])),
        "ticks": [
            [tick.get_text() for tick in ticks]
            for ticks in (axes.get_xticklabels(), axes.get_yticklabels())
        ],
        "legend": _legend(axes.get_legend()),
        "texts": [
            [text.get_text(), array(np.array(text.get_position(), dtype=float))]
            for text in axes.texts
        ],
        "lines": [],
        "patches": [],
        "collections": [],
        "images": [array(np.ma.filled(image.get_array(), np.nan)) for image in axes.images],
    }
    for line in axes.lines:
        shown["lines"].append({
            "label": _label(line), "style": [str(line.get_linestyle()), str(line.get_marker())],
            "colour": _colour(line.get_color()), "data": array(np.array(line.get_xydata(), dtype=float)),
        })  # fmt: skip
    for patch in axes.patches:
        corners = patch.get_path().transformed(patch.get_patch_transform()).vertices
        shown["patches"].append({
            "label": _label(patch), "colour": _colour(patch.get_facecolor()),
            "corners": array(np.asarray(corners)),
        })  # fmt: skip
    for collection in axes.collections:
        paths = collection.get_paths()
        values = collection.get_array()
        shown["collections"].append({
            "label": _label(collection), "places": array(np.ma.filled(collection.get_offsets(), np.nan)),
            "paths": array(np.vstack([path.vertices for path in paths])) if paths else None,
            "values": None if values is None else array(np.ma.filled(values, np.nan)),
        })  # fmt: skip
    return shown


def _label(artist):
    label = str(artist.get_label())
    return "" if label.startswith("_") else label


def _colour(colour):
    from matplotlib.colors import to_hex

    try:
        return to_hex(colour)
    except ValueError:
        return str(colour)


def of_page(page, depth=0):
    """Return a page: its panels, labels, buttons, times, and every element by its name."""
    return {
        "title": page.title,
        "printed": repr(page),
        "warnings": plain(page.warnings),
        "buttons": list(page.pages),
        "scenes": [
            {
                "panel": text_of(panel),
                "labels": text_of("\n".join(window.labels)),
                "times": None if times is None else array(np.asarray(times, dtype=float)),
                "elements": _elements(window.commands),
            }
            for window, panel, times in page.scenes
        ],
    }


def of_html(html):
    """Return what is written in the file of a page: its text and elements, without the engine."""
    import umsgpack

    packed = re.findall(r'^"([A-Za-z0-9+/=]+)",?$', html, re.MULTILINE)
    parts = re.sub(r"<script.*?</script>|<style.*?</style>", "", html, flags=re.DOTALL)
    return {
        "text": text_of(parts),
        "elements": _elements([base64.b64decode(text) for text in packed], umsgpack),
    }


def _elements(commands, umsgpack=None):
    """Return a line of each meshcat command: where it acts, and a digest of what it holds."""
    if umsgpack is None:
        import umsgpack
    return [
        [command.get("type", ""), command.get("path", ""), _content(command)]
        for command in map(umsgpack.unpackb, commands)
    ]


def _content(command):
    return {
        key: _contained(item)
        for key, item in sorted(command.items())
        if key not in ("type", "path")
    }


def _contained(item):
    if isinstance(item, dict):
        if "track" not in item and {"time", "value"} == set(item):
            return [item["time"], _contained(item["value"])]
        return {
            key: _contained(value) for key, value in sorted(item.items()) if _counts(key, value)
        }
    if isinstance(item, list | tuple):
        if item and isinstance(item[0], int | float):
            return array(np.array(item, dtype=float))
        if len(item) > 4 and isinstance(item[0], dict) and set(item[0]) == {"time", "value"}:
            times = np.array([key["time"] for key in item], dtype=float)
            return [array(times), array(np.array([key["value"] for key in item], dtype=float))]
        return [_contained(value) for value in item]
    if type(item).__name__ == "Ext":
        kind = {0x12: np.uint8, 0x15: np.int32, 0x16: np.uint32, 0x17: np.float32}.get(item.type)
        return f"{len(item.data)} bytes" if kind is None else array(np.frombuffer(item.data, kind))
    return plain(item)


def _counts(key, value):
    """Return whether an entry of a command is chosen by kickdyn: no random name, no default."""
    if key in ("geometry", "material") and isinstance(value, str):
        return False
    return key not in (
        "uuid", "metadata", "image", "images", "itemSize", "normalized", "linewidth", "wireframe",
        "wireframeLinewidth", "reflectivity", "fps", "name" if value == "default" else "uuid",
    )  # fmt: skip


def of_file(path):
    """Return what a file holds, by its ending."""
    import json

    ending = path.suffix.lower()
    if ending == ".json":
        return plain(json.loads(path.read_text()))
    if ending in (".html", ".htm"):
        return of_html(path.read_text(encoding="utf-8"))
    if ending in (".csv", ".yaml", ".xml", ".txt", ".toml", ".trc"):
        lines = path.read_text().splitlines()
        few = (
            lines
            if len(lines) < 40
            else [*lines[:12], *lines[len(lines) // 2 : len(lines) // 2 + 4], *lines[-8:]]
        )
        return {"lines": len(lines), "text": [text_of(line)[:600] for line in few]}
    if ending == ".npz":
        with np.load(path) as arrays:
            return {name: plain(arrays[name]) for name in sorted(arrays)}
    if ending == ".nc":
        import xarray as xr

        with xr.open_dataset(path) as data:
            return of_dataset(data.load())
    return "written"


def of_spline(spline, depth=0):
    """Return a scipy B-spline."""
    return {"knots": array(spline.t), "coefficients": array(spline.c), "degree": spline.k}


_SPECIAL = {
    "Leg": of_leg, "Dataset": of_dataset, "Figure": of_figure, "Page": of_page, "BSpline": of_spline,
}  # fmt: skip
