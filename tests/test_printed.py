"""Tables of results show the numbers of their objects in the units that they say."""

import html
import math
import re
from functools import reduce
from importlib import import_module
from pkgutil import walk_packages

import numpy as np
import pytest
from one_of_each import MADE, one
from shown_numbers import numbers_of
from tolerances import closed_form

import kickdyn as kd
from kickdyn.core.representation import ReprMixin
from kickdyn.planning.kick_reader import AXES

SCALES = {"deg": math.degrees(1.0), "ms": 1e3, "mm": 1e3, "%": 100.0}
"""What a number in SI units is multiplied by for a unit; 1 for the others."""

IN_TABLES = [SCALES["deg"] if axis in ("elevation", "azimuth") else 1.0 for axis in AXES]
"""The same for the axes of a library of kicks."""

PATHS = {
    "impulse on the ball": "impulse|impact.impulse", "ball after": "ball_after.velocity",
    "spin after": "ball_after.spin", "foot before": "foot_velocity",
    "ball over foot speed": "speed_ratio", "with all joints free": "free_effective_mass",
    "work of the motors": "motor_work", "condition": "condition|posture.condition",
    "launch": "launch.velocity|velocity|impact.ball_after.velocity|ball_after.velocity",
    "spin": "launch.spin|spin|state.spin", "height": "height", "landing": "landing.position",
    "landing speed": "landing.speed", "end": "rest.position|end.position|end", "posture": "q",
    "joint velocity": "v", "share of the speed limit": "speed_use",
    "share of the torque limit": "torque_use", "share of the change of velocity": "share",
    "place": "ball.position", "time": "time|end.time|ball.time", "rms distance": "rms",
    "position": "state.position", "velocity": "state.velocity", "time step": "timestep",
    "rolling deceleration": "surface.rolling_deceleration", "friction": "friction|surface.friction",
    "restitution": "restitution|impact.restitution|surface.restitution",
    "direction error": "direction_error", "miss of the target": "miss",
    "standard deviation of the end": "end_deviation", "delay of the contact": "delay",
    "height of the ground": "scene.ground.height",
    "next launch": "command.velocity",
    "foot speed": "foot_speed", "scatter of a kick": "scatter",
    "contact time": "contact_time|law.contact_time", "ball's velocity": "incoming.velocity",
    "ball's spin": "incoming.spin", "contact point": "contact_point|posture.contact_point",
}  # fmt: skip
"""Paths of attributes, the first of which that exists is meant, for rows of another name."""


FORMULAS = {
    ("track", "samples"): lambda track: len(track.times),
    ("track", "duration"): lambda track: track.times[-1] - track.times[0],
    ("track", "median interval"): lambda track: np.median(np.diff(track.times)),
    ("track", "lowest corner"): lambda track: track.positions.min(axis=0),
    ("track", "highest corner"): lambda track: track.positions.max(axis=0),
    ("leg", "mass"): lambda leg: sum(body.mass for body in leg.model.inertias),
    ("scene", "foot speed"): lambda scene: np.linalg.norm(scene.posture.jacobian @ scene.v),
    ("launch", "time"): lambda launch: launch.flight.duration,
    ("launch", "largest error"): lambda launch: np.abs(launch.errors).max(),
    ("pass", "time"): lambda launch: launch.course.rest.time,
    ("plan", "objective joint-speed"):
        lambda plan: np.mean((plan.v / plan.leg.velocity_limit) ** 2),
    ("plan", "contact above the ball's centre"): lambda plan: contact_point(plan.impact)[0],
    ("plan", "contact to the left of it"): lambda plan: round(contact_point(plan.impact)[1], 12),
    **{("plan", f"ball displaced {way}"): lambda plan, way=way: getattr(
        plan.sensitivity_to_ball, way).direction_deg for way in ("along", "across")},
    ("reach", "azimuth -10, elevation 20 deg"): lambda reach: (21.43, 31.3, 44.3),
    **{("library", axis): lambda library, k=k: IN_TABLES[k] * library.reader.lower[k]
       for k, axis in enumerate(AXES)},
    **{("library kick", axis): lambda kick, k=k: IN_TABLES[k] * kick.point[k]
       for k, axis in enumerate(AXES)},
    **{("library kick", row): lambda kick, unit=unit: min(
        value for name, value in kick.margins.items() if name.partition(" [")[2] == unit)
       for row, unit in (("least margin", ""), ("least distance", "m]"), ("least angle", "rad]"))},
    ("library", "motions"): lambda library: len(library.reader.arrays["coefficients"]),
    ("library", "covered share of the ranges"): lambda library: library.covered,
    ("leg motion", "contact"): lambda motion: (0.14, 0.0014),
    ("leg motion", "frames"): lambda motion: len(motion.times),
    ("leg motion", "duration"): lambda motion: np.ptp(motion.times),
    ("body", "frames"): lambda body: len(body.times),
    ("course", "bounces"): lambda course: len(course.bounces),
    ("pass", "bounces"): lambda launch: len(launch.course.bounces),
    ("identification", "samples"): lambda fit: (fit.used.sum(), fit.used.size),
    ("learner", "kicks"): lambda learner: len(learner.shots),
    ("slow scene", "foot speed"): lambda scene: np.linalg.norm(scene.posture.jacobian @ scene.v),
    ("unreachable", "largest error"): lambda launch: np.abs(launch.errors).max(),
    ("goal", "beside"): lambda goal: goal.beside,
    ("inferred", "normal"): lambda inferred: inferred.normal,
    ("learner", "landing scatter"): lambda x: math.sqrt(np.trace(x.landing_scatter)),
    ("learner", "landing uncertainty"): lambda x: math.sqrt(np.trace(x.landing_uncertainty)),
    ("tuning", "error, this kick"): lambda tuning: (2.0, 3.0, 0.6),
    ("run", "speed error"): lambda run: speeds(run) - 1.0,
    ("noisy runs", "speed error"): lambda noisy: mean_and_deviation(map(speeds, noisy.runs), 1.0),
    ("noisy runs", "azimuth error"): lambda noisy: mean_and_deviation(
        map(azimuth, [run.ball_after for run in noisy.runs]), azimuth(one("plan").launch)),
    ("noisy runs", "miss, 90% of the runs"): lambda noisy: max(noisy.misses),
    ("body", "duration"): lambda body: 0.09,
    ("motion record", "frames"): lambda motion: len(motion.t),
    ("motion record", "smoothing, position of joints"):
        lambda motion: motion.smoothing[0][1],
    ("motion record", "smoothing, velocity of joints"):
        lambda motion: motion.smoothing[1][1],
    ("motion check", "frames"): lambda check: len(check.motion.t),
    ("motion check", "frames with an impact"):
        lambda check: np.isfinite(check.launches.ball_speed.values).sum(),
    ("file", "rate"): lambda found: found.rows[0][1],
}  # fmt: skip
"""Rows that are computed from attributes, in SI units."""


OF_JOINTS = {
    "speed of ": lambda at, k: (at.v[k], at.v_deviations[k]),
    "joint ": lambda leg, k: (leg.lower[k], leg.upper[k]),
    "worst joint, ": lambda hit, k: np.linalg.norm(hit.joint_impulses[k, :3]),
    "best frame, impulse in ": lambda check, k: np.linalg.norm(
        check.launches.joint_impulses.values[check.best, k, :3]),
    "impulse in ": lambda hit, k: (np.linalg.norm(hit.joint_impulses[k, :3]),
                                   hit.joint_deviations[hit.posture.leg.joint_names[k]]),
    "": lambda posture, k: posture.q[k],
}  # fmt: skip
"""Rows that end with a joint, by what comes before it."""


TEXTS = {
    "method", "another", "wall and goal", "residuals", "digits at least", "incomplete frames",
    "gaps of b", "ball", "contact", "air", "ground", "nearest", "solref", "solimp",
    "solreffriction", "goal, speed", "goal, direction", "goal, speed x 0.5 to 1.5",
    "error, speed x 0.5", "azimuth 0, elevation 35 deg", "hit the ball", "elevation error",
    "miss, 50% of the runs", "warning", "broken",
}  # fmt: skip
"""Rows with numbers in a text of several words, or whose like is compared."""


def contact_point(impact):
    """Return the contact point above the ball's centre, and to the left as the ball flies [m]."""
    arm, velocity = -impact.ball.radius * impact.contact.normal, impact.ball_after.velocity
    return arm[2], (velocity[0] * arm[1] - velocity[1] * arm[0]) / np.hypot(*velocity[:2])


def speeds(run):
    return np.linalg.norm(run.ball_after.velocity) / np.linalg.norm(run.plan.launch.velocity)


def azimuth(ball):
    return math.atan2(ball.velocity[1], ball.velocity[0])


def mean_and_deviation(values, less):
    values = np.array(list(values)) - less
    return values.mean(), values.std(ddof=1)


def table(shown):
    """Return name, text and unit of each row of a notebook's table."""
    cell = r"<t[hd][^>]*>(.*?)</t[hd]>"
    rows = re.findall(rf"<tr>{cell}{cell}{cell}</tr>", shown._repr_html_())
    return [tuple(map(html.unescape, row)) for row in rows]


def right_value(name, shown, row):
    """Return the value that a row must show, in SI units; None for a row of words."""
    if (name, row) in FORMULAS:
        return FORMULAS[name, row](shown)
    deviations = getattr(shown, "deviations", {})
    for values in ("values", "estimates"):
        if row in getattr(shown, values, {}):
            return getattr(shown, values)[row], deviations[row]
    leg = getattr(shown, "leg", getattr(getattr(shown, "posture", None), "leg", shown))
    for words, of_joint in OF_JOINTS.items():
        if row.removeprefix(words) in getattr(leg, "joint_names", ()) and row.startswith(words):
            return of_joint(shown, leg.joint_names.index(row.removeprefix(words)))
    if re.match(r"at [\d.]+ m/s", row):  # the restitution of a table over speed
        k = np.abs(np.array(shown.table)[:, 0] - float(row.split()[1])).argmin()
        return shown.table[k][1], shown.deviations[k]
    if row.startswith(("impulse by ", "joint impulse by ")):
        kind, source = re.match(r"(.*) by (\w+)", row).groups()
        slopes = getattr(shown, kind.replace(" ", "_") + "s" * (kind != "impulse"))[source]
        slopes = [joint[:3] for joint in slopes] if kind != "impulse" else [slopes]
        return max(np.linalg.svd(rows, compute_uv=False)[0] for rows in slopes)
    if row.startswith("the end without "):
        return shown.effect_sizes[row[16:]]
    if row.startswith("limit "):
        return shown.posture.effective_mass_limits(shown.contact.normal)[row[6:]]
    if row.startswith("best frame, ") and " in " not in row:
        return shown.launches[row[12:].replace(" ", "_")].values[shown.best]
    if row.startswith("margin, "):
        return shown.margins[row[8:]]
    for path in PATHS.get(row, row.replace(" ", "_")).split("|"):
        try:
            value = reduce(getattr, path.split("."), shown)
        except AttributeError:
            continue
        if isinstance(value, float | int | np.ndarray | np.number) and not isinstance(value, bool):
            return value, *([deviations[row]] if row in deviations else [])
    return None


@pytest.mark.parametrize("name", MADE)
def test_a_row_shows_its_number_in_its_unit(name):
    shown, compared = one(name), 0
    for row, text, unit in table(shown):
        right = right_value(name, shown, row)
        if right is None or row in TEXTS or not numbers_of(text):
            assert row in TEXTS or not numbers_of(text), f"{row} is not compared"
            continue
        scale = SCALES.get("%" if text.endswith("%") else unit.split(",")[0], 1.0)
        right = right if isinstance(right, tuple) else (right,)
        right = np.concatenate([np.ravel(value) for value in right]) * scale
        numbers = numbers_of(text)
        assert len(numbers) >= len(right), f"{row}: {text}"
        for number, value in zip(numbers, right.tolist(), strict=False):
            # without decimals, zeros after the point may have been left out
            last = number.last if "." in number.text else min(number.last, 0.1 * abs(number.value))
            unit_of_rounding = max(last, closed_form(10) * np.abs(right).max(initial=1.0))
            assert number.value == pytest.approx(value, abs=0.51 * unit_of_rounding), (row, text)
        compared += 1
    assert compared or name in ("scene", "motion", "leg motion")


@pytest.mark.parametrize("name", MADE)
def test_text_and_html_have_the_same_numbers(name):
    shown = one(name)
    if type(shown).__repr__ is ReprMixin.__repr__:
        of_table = [number.text for row in table(shown) for number in numbers_of(" ".join(row))]
        title = type(shown).__name__
        assert [number.text for number in numbers_of(repr(shown).removeprefix(title))] == of_table


@pytest.mark.parametrize("name", ["run", "noisy runs", "reach"])
def test_json_has_the_numbers_of_the_attributes(name):
    shown = one(name)
    rows = zip(shown.rows, shown.to_json()["rows"], strict=True) if name == "reach" else [
        (shown, shown.to_json())]  # fmt: skip
    compared = 0
    for of_attributes, document in rows:
        for key, value in document.items():
            right = getattr(of_attributes, key, None)
            if isinstance(right, int | float | str | np.ndarray):
                assert value == (right.tolist() if isinstance(right, np.ndarray) else right), key
                compared += 1
    assert compared > 2


def test_every_class_with_a_table_is_compared():
    for module in walk_packages(kd.__path__, "kickdyn."):
        if not module.name.endswith("__main__") and module.name != "kickdyn.posture_sweep":
            import_module(module.name)

    def below(kind):
        return {kind}.union(*(below(further) for further in kind.__subclasses__()))

    kinds = {kind for kind in below(ReprMixin) - {ReprMixin} if "_rows" in vars(kind)}
    assert {kind for kind in kinds if kind.__module__.startswith("kickdyn.")} <= {
        type(one(name)) for name in MADE
    }
