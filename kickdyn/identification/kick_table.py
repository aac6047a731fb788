"""`kick_table`: measured kicks side by side, for a paper."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from kickdyn.core import validation
from kickdyn.errors import InvalidInput
from kickdyn.identification.infer_impact import InferredImpact


@validation.check_arguments
def kick_table(kicks: Mapping[str, InferredImpact]) -> Any:
    """Return measured kicks as a table, a pandas `DataFrame`, with their standard deviations.

    Each row is a quantity with its unit. Each kick has two columns: its name, and its name with
    `+-` for the standard deviations, NaN if unknown.

    Args:
        kicks: impacts of legs with joints of the same names, by name of the kick.

    Raises:
        InvalidInput: no kick, or legs with other joints.
    """
    from xarray import DataArray  # loaded when a table is asked for

    if not validation.mapping("kicks", kicks):
        raise InvalidInput("kicks is empty: it must have impacts by the name of the kick")
    for name, impact in kicks.items():
        validation.check_type(InferredImpact, **{f"kick {name}": impact})
    rows = {name: _rows(impact) for name, impact in kicks.items()}
    titles = list(next(iter(rows.values())))
    for name, of_kick in rows.items():
        if list(of_kick) != titles:
            raise InvalidInput(f"kick {name!r} has other joints than {next(iter(kicks))!r}")
    values = np.hstack([list(of_kick.values()) for of_kick in rows.values()])
    columns = [title for name in kicks for title in (name, f"{name} +-")]
    table = DataArray(values, {"quantity": titles, "kick": columns}, ("quantity", "kick"))
    return table.to_pandas()


def _rows(impact: InferredImpact) -> dict[str, tuple[float, float]]:
    """Return quantities of an impact with their standard deviations, by title."""
    values = {
        "foot speed [m/s]": (math.hypot(*impact.foot_velocity), "foot_speed"),
        "ball speed [m/s]": (float(impact.ball_after.speed), "ball_speed"),
        "impulse on the ball [N s]": (math.hypot(*impact.impulse), "impulse"),
        "effective mass [kg]": (impact.effective_mass, "effective_mass"),
        "restitution": (impact.restitution, "restitution"),
    }
    rows = {title: (x, impact.deviations.get(key, math.nan)) for title, (x, key) in values.items()}
    for name, size in impact.joint_sizes.items():
        rows[f"impulse in {name} [N s]"] = (size, impact.joint_deviations.get(name, math.nan))
    return rows
