"""The dataset of a sweep: its variables with units, the status flags, and its provenance."""

import hashlib
import math
import re
from collections.abc import Iterable
from contextlib import suppress
from importlib import metadata
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn._version import __version__
from kickdyn.air import Air
from kickdyn.core.identity import DIGITS, NotIdentifiedError, digest
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.laws import normal_impulse
from kickdyn.restitution import format_restitution, range_warnings
from kickdyn.robot.joint_table import DEGREES, look_like_degrees
from kickdyn.robot.leg import Leg
from kickdyn.robot.names import unknown
from kickdyn.sweeps.grid import DECIMALS, Grid
from kickdyn.sweeps.sweep_kick import Kick, PostureOutcome, PostureStatus

VARIABLES = {
    "effective_mass": ("kg", "effective mass of the leg along the normal"),
    "impulse": ("N s", "impulse on the ball"),
    "immovable_impulse": ("N s", "impulse on an obstacle that cannot move, the paper's Table 2"),
    "ball_speed": ("m/s", "speed of the ball after the impact"),
    "speed_ratio": ("1", "ball speed over foot speed"),
    "launch_angle": ("rad", "launch above the horizontal"),
    "back_spin": ("rad/s", "spin of the ball after the impact about -y; negative is top spin"),
    "worst_joint_impulse": ("N s", "largest linear impulse inside a joint"),
    "energy_lost": ("J", "energy lost to restitution and friction"),
    "speed_use": ("1", "least possible value of the largest joint speed over its limit"),
    "carry": ("m", "horizontal distance to where the ball is back at its launch height"),
    "restitution_residual": ("1", "relative error of Newton's restitution"),
    "momentum_residual": ("1", "relative momentum that Newton-Euler cannot account for"),
}
"""Name of every variable of a dataset but `status`, with its unit and meaning.

A new one comes last. `variables_of` computes it for one posture, and `fill_variables` in
`kernel.py` for large grids.
"""

STATUS_ATTRIBUTES: dict[str, Any] = {
    "long_name": "whether the leg can perform the kick",
    "flag_values": np.array([status.flag for status in PostureStatus], np.int8),
    "flag_meanings": " ".join(PostureStatus),
}
"""Attributes of the int8 variable `status`, as the CF conventions have flags."""

_DIFFERENT_HASH = {
    "leg_sha256": "the text of its leg's URDF is not this one's",
    "model_sha256": "its leg's model is not this one's: masses, lengths, armature, locked joints, "
    "supports, loops, mimic joints or stiff joints",
    "air_sha256": "its air is not this one's: digits that are not printed, or functions",
}
"""What a difference of two hashes means."""


def describe(leg: Leg, grid: Grid, kick: Kick, carry_tolerance: float) -> xr.Dataset:
    """Return the dataset of a sweep without its variables: coordinates and provenance.

    It has a coordinate per joint [rad; m], of a list along `posture`, and, of angles, the same in
    degrees under the name `JOINT_deg`. Attributes follow the CF conventions; `finished` is 0.
    `carry_tolerance` is the largest error of carries that are interpolated [m], 0 where every ball
    is flown. Raises
    `InvalidInput` where a joint and a variable have the same name.
    """
    attributes = {"Conventions": "CF-1.11", **provenance(leg, kick)}
    farthest = {name: values[np.abs(values).argmax()] for name, values in grid.axes.items()}
    if look_like_degrees(leg, leg.configuration(farthest)):  # of joints without a range
        attributes["warnings"] = "; ".join([*sweep_warnings(leg, kick), DEGREES])
    data = xr.Dataset(attrs={**attributes, "carry_tolerance_m": carry_tolerance, "finished": 0})
    for name, values in grid.axes.items():
        shadows = name.endswith("_deg") and name.removesuffix("_deg") in grid.axes
        shadows |= grid.is_list and name in grid.dims
        is_no_name = "/" in name or not name.strip(".")
        if shadows or is_no_name or name in [*VARIABLES, "status"]:
            fault = "no variable can have" if is_no_name else "another variable has"
            raise InvalidInput(
                f"joint {name!r} cannot be swept: {fault} this name in the dataset; rename the "
                "joint, or leave it out"
            )
        unit = leg.joint_unit(name)
        dim = grid.dims[0] if grid.is_list else name
        data.coords[name] = (dim, values, {"units": unit, "long_name": f"{name} joint"})
        if unit == "rad" and " " not in name:  # netCDF takes no coordinate with a space
            degrees = np.round(np.degrees(values), DECIMALS) + 0.0  # no -0
            data.coords[f"{name}_deg"] = (dim, degrees, {
                "units": "degree", "long_name": f"{name} joint, in degrees"})  # fmt: skip
    return data


def select_variables(names: Iterable[str] | None) -> tuple[str, ...]:
    """Return the names among `VARIABLES` that a sweep keeps, in their order; None keeps all.

    `status` is always kept and may be named. Raises `InvalidInput` where a name is unknown.
    """
    if names is None:
        return tuple(VARIABLES)
    wanted, choices = [] if isinstance(names, str) else list(names), [*VARIABLES, "status"]
    if not wanted:
        raise InvalidInput(f"variables is {names!r}: it must be a list of {', '.join(choices)}")
    for name in wanted:
        if not isinstance(name, str) or name not in choices:
            raise InvalidInput(unknown("variable", name, "a sweep", choices))
    return tuple(name for name in VARIABLES if name in wanted)


def with_variables(
    described: xr.Dataset,
    rows: Array,
    status: NDArray[np.int8],
    kept: Iterable[str] = tuple(VARIABLES),
) -> xr.Dataset:
    """Return a dataset that has been described, with the variables that are kept.

    `rows` has values in the order of `VARIABLES`, shape `(len(VARIABLES), n)`; `status` has flags,
    shape `(n,)`.
    """
    dims = [str(name) for name in described.dims]
    shape = tuple(described.sizes[name] for name in dims)
    by_name = dict(zip(VARIABLES, rows, strict=True))
    variables = {name: (dims, by_name[name].reshape(shape), attributes_of(name)) for name in kept}
    flags = (dims, status.reshape(shape), dict(STATUS_ATTRIBUTES))
    return described.assign({**variables, "status": flags})  # at once: one by one takes longer


def attributes_of(name: str) -> dict[str, str]:
    """Return the attributes of one of `VARIABLES`, as the CF conventions have them."""
    unit, meaning = VARIABLES[name]
    return {"units": unit, "long_name": meaning}


def variables_of(outcome: PostureOutcome, kick: Kick) -> dict[str, float]:
    """Return the values of `VARIABLES` for one posture; nan where it is out of reach."""
    impact = outcome.impact
    if impact is None:
        return dict.fromkeys(VARIABLES, math.nan)
    mass = float(impact.effective_mass)
    return {
        "effective_mass": mass,
        "impulse": math.hypot(*impact.impulse),
        "immovable_impulse": normal_impulse(impact.approach_speed, kick.restitution_used, mass),
        "ball_speed": float(impact.ball_after.speed),
        "speed_ratio": impact.speed_ratio,
        "launch_angle": float(impact.ball_after.elevation),
        "back_spin": 0.0 - float(impact.ball_after.spin[1]),
        "worst_joint_impulse": impact.worst_joint[1],
        "energy_lost": impact.energy_lost,
        "speed_use": outcome.speed_use,
        "carry": outcome.carry,
        "restitution_residual": impact.restitution_residual,
        "momentum_residual": impact.momentum_residual,
    }


def provenance(leg: Leg, kick: Kick) -> dict[str, str | float]:
    """Return the inputs of a sweep, enough to compute it again, as plain values."""
    air, restitution = kick.air, kick.contact.restitution
    if not isinstance(restitution, float):
        restitution = format_restitution(restitution).strip("'")
    text, air_hash = "" if leg.file is None else leg.file.text, ""
    with suppress(NotIdentifiedError):
        air_hash = _air_digest(air)
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("pin", "numpy", "scipy"))
    return {
        "title": f"kicking postures of {leg.name}",
        "source": f"kickdyn {__version__} ({versions})",
        "leg": leg.name,
        "leg_sha256": hashlib.sha256(text.encode()).hexdigest() if text else "",
        "model_sha256": hashlib.sha256(_model_text(leg).encode()).hexdigest(),
        "frame": leg.frame,
        "warnings": "; ".join(sweep_warnings(leg, kick)),
        "foot_speed_m_s": kick.speed,
        "attack_deg": round(float(np.degrees(kick.attack)), 10),
        "attack_rad": kick.attack,
        "restitution": kick.restitution_used,
        "restitution_given": restitution,
        "friction": kick.friction,
        "impact_law": kick.law,
        "ball_mass_kg": kick.ball.mass,
        "ball_radius_m": kick.ball.radius,
        "ball_inertia_factor": kick.ball.inertia_factor,
        "air": "none" if air is None else repr(air),
        "air_sha256": air_hash,
    }


def sweep_warnings(leg: Leg, kick: Kick) -> tuple[str, ...]:
    """Return a line for each thing to know about leg and ball, and the restitution's range."""
    in_range = range_warnings(kick.contact.restitution, kick.speed)
    return (*leg.warnings, *kick.ball.warnings, *in_range)


def difference(
    stored: xr.Dataset, wanted: xr.Dataset, kept: Iterable[str] = tuple(VARIABLES)
) -> str | None:
    """Return the first difference between two sweeps as a sentence, None without one.

    `wanted` is described, and `kept` are its variables, in the order of `VARIABLES`.
    Every attribute but `finished` and `warnings` and every value of the grid is compared, to the
    last digit; what follows from other numbers by roots and powers, such as the leg's model, the
    air and `restitution`, to 12 digits, because later ones differ between processors.
    """
    joints = [", ".join(map(str, dims)) for dims in (stored["status"].dims, wanted.dims)]
    if joints[0] != joints[1]:
        return f"its joints are {joints[0]}, this one's {joints[1]}"
    for name in wanted.coords:
        if name not in stored or not np.array_equal(stored[name].values, wanted[name].values):
            return f"its values of {name} are not all the same"
    for attribute, value in wanted.attrs.items():
        other = stored.attrs.get(attribute)
        is_computed = attribute == "restitution" and isinstance(other, float)
        if is_computed and math.isclose(float(other or 0), value, rel_tol=10.0**-DIGITS):
            continue
        if attribute not in ("finished", "warnings") and other != value:
            plain = f"its {attribute} is {other!r}, this one's {value!r}"
            return _DIFFERENT_HASH.get(attribute, plain)
    names = [", ".join(n for n in VARIABLES if n in sweep) for sweep in (stored, tuple(kept))]
    if names[0] != names[1]:
        return f"its variables are {names[0]}, this one's {names[1]}"
    return None


def _model_text(leg: Leg) -> str:
    """Return every number of a leg's model and its constraints as a text, to 12 digits.

    Later digits of what readers compute are rounding, which differs between processors.
    """
    constraints = leg.constraints
    supports, loops = ([], []) if constraints is None else (constraints.supports, constraints.loops)
    stands, gears = [(s.frame, s.point) for s in supports], [tuple(m) for m in leg.mimics]
    stiff = list(leg.stiff_joints)
    text = f"{leg.model.saveToString()} {stands} {list(loops)} {gears} {stiff}"
    if leg.base_velocity is not None:
        text = f"{text} {leg.base_velocity.tolist()}"
    return re.sub(r"-?\d+\.\d+(e[-+]\d+)?", _without_rounding, text)


def _without_rounding(number: re.Match[str]) -> str:
    value = float(number[0])
    return f"{value:.{DIGITS}g}" if abs(value) > 1e-13 else "0"


def check_identified(kick: Kick) -> None:
    """Raise `InvalidInput` if a stored sweep cannot be compared with this kick's air."""
    try:
        _air_digest(kick.air)
    except NotIdentifiedError as error:
        raise InvalidInput(
            f"the stored sweep cannot be continued: of the air, {error}; define functions in a "
            "file, with numbers and functions only"
        ) from None


def _air_digest(air: Air | None) -> str:
    """Return a digest of all numbers and functions of an air; empty without air."""
    if air is None:
        return ""
    models = air.wind, air.drag, air.lift, air.torque
    return digest((air.density, air.viscosity, air.buoyancy, *models))
