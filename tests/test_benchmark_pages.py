"""Pages show the numbers of benchmarks; shipped legs have those of the paper's tables."""

import contextlib
import csv
import io
import math
import re
import runpy
from collections import Counter
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import inflated_ball
import numpy as np
import pytest
import validation
from flight_methods import measure_flights
from impact_methods import kick
from references.exact_impact import exact_impact, given
from scipy.integrate import solve_ivp
from shown_numbers import Number, first_missing, numbers_of
from tolerances import closed_form, integrated

import kickdyn as kd
from kickdyn.paper import fig_10, fig_15, table_2, tables_4_5
from kickdyn.paper.assumptions import ALTERNATIVES, DEFAULT
from kickdyn.robot.urdf_file import shipped_urdf

ROOT = Path(__file__).resolve().parent.parent
EXPLANATION = ROOT / "docs" / "explanation"


@pytest.mark.slow
@pytest.mark.parametrize(("script", "page"), [
    ("inflated_ball.py", "inflated-ball.md"), ("compliance.py", "compliance.md")])  # fmt: skip
def test_the_table_of_a_page_is_printed(script, page, monkeypatch):
    monkeypatch.setattr("sys.argv", [script])
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        runpy.run_path(str(ROOT / "benchmarks" / script), run_name="__main__")
    rows = re.findall(r"(?m)^\| \d.*", (EXPLANATION / page).read_text("utf-8"))
    assert rows
    for row in rows:
        assert first_missing(row, printed.getvalue()) is None, row
    if script == "compliance.py":  # the contact time of a Hertzian spring k falls with k^-0.4
        table = printed.getvalue().split("order in k", 1)[1].split("\n\n")[0].splitlines()
        orders = [float(row.strip("| ").split(" | ")[-1]) for row in table[-2:]]
        assert orders == pytest.approx([-0.4, -0.4], abs=0.005)


def rows_of_verification(heading):
    """Return the cells of the table with this heading, row by row."""
    text = (EXPLANATION / "verification.md").read_text("utf-8")
    lines = text.split(f"| {heading} |", 1)[1].split("\n\n", 1)[0].splitlines()[2:]
    return [[cell.strip(" `") for cell in line.strip("|").split(" | ")] for line in lines]


@pytest.mark.slow
def test_the_errors_of_the_kick():
    pytest.importorskip("mujoco")
    from mujoco_comparison import mujoco_kick

    impact = kick(0.0)
    exact = exact_impact(*given(impact))["impulse"]
    (_, bound, _), *simulated = rows_of_verification("Impulse")
    assert exact.error(impact.impulse) < float(bound.removeprefix("<"))
    for name, error, _ in simulated:
        stiffness, dt = map(float, re.fullmatch(r"MuJoCo, (\S+) N/m, dt (\S+) s", name).groups())
        right = exact.error(mujoco_kick(impact, stiffness, dt)())
        assert float(error) == pytest.approx(right, rel=0.02), name


@pytest.mark.slow
def test_the_errors_of_the_flights():
    """An integrator's error at a tolerance depends on rounding in the choice of its steps."""
    measured = {row.method: row.error for row in measure_flights([1e-9]) if row.scene == "full"}
    for name, error, _ in rows_of_verification("Method"):
        right = measured[name.removeprefix("scipy's `")]
        assert float(error) == pytest.approx(right, rel=0.1), name


@pytest.mark.parametrize("mass", [0.86, 1.95, 40.0])
def test_an_inflated_ball_on_a_foot_that_moves_by_integration_over_time(mass):
    """Ball and foot with the flat part of the shell, whose mass grows and falls."""
    ball, pressure, speed = inflated_ball.INFLATED, 80e3, 17.0
    m, radius = ball.mass, ball.radius

    def push(u):
        return pressure * math.pi * radius**2 * u * (2 - u)

    def closing(_, y):  # u, speed of approach
        u, w = y
        taken = (push(u) + m * w * w / (2 * radius)) / (mass + 0.5 * m * u)
        return w / radius, -push(u) / (m * (1 - 0.5 * u)) - taken

    def opening(_, y):  # u, speed of separation
        u, w = y
        pulled = (push(u) - m * w * w / (2 * radius)) / (m * (1 - 0.5 * u))
        return -w / radius, pulled + push(u) / (mass + 0.5 * m * u)

    def at_rest(_, y):
        return y[1]

    def apart(_, y):
        return y[0]

    at_rest.terminal = apart.terminal = True
    at_rest.direction = apart.direction = -1
    tol = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    end = solve_ivp(closing, (0, 0.1), (0, speed), events=at_rest, **tol).y[:, -1]
    after = solve_ivp(opening, (0, 0.1), (end[0], 0.0), events=apart, **tol).y[1, -1]
    ratio = inflated_ball.ratio_of_foot(mass, speed)
    assert ratio == pytest.approx(after / speed, rel=integrated(1e-10))


README, PAPER = (
    " ".join(file.read_text("utf-8").split())
    for file in (ROOT / "README.md", EXPLANATION / "paper.md")
)


def rows(path):
    """Return the cells of the rows of comparisons on a page."""
    lines = path.read_text("utf-8").splitlines()
    return [line.strip("| ").split(" | ") for line in lines if re.match(r"\| [MAPV]\d+ \|", line)]


PAGE, SHORT = rows(EXPLANATION / "validation.md"), rows(ROOT / "README.md")
TABLE = (EXPLANATION / "validation.csv").read_text("utf-8")
WITH_ASSUMPTIONS = list(csv.DictReader(TABLE.splitlines()))


@pytest.mark.slow
def test_rows_have_the_numbers_and_verdicts_of_the_script():
    """All but the row on the flights of the match, which takes long: the next test has some."""
    computed = [
        row for section in validation.PARTS if section != validation.tracked for row in section()
    ]
    for shown in (row for row in (*PAGE, *SHORT) if not re.match("A1|[PV]", row[0])):
        same = [
            row for row in computed if row.number == shown[0] and shown[1] in (row.what, row.short)
        ]
        assert same, shown
        assert first_missing(shown[3], same[0].ours) is None, (shown[3], same[0].ours)
        assert shown[4] == same[0].verdict, shown


def test_the_rules_of_the_verdicts():
    agrees, partly, disagrees = "agrees", "**partly**", "**disagrees**"
    assert validation.within(1, 3, 1, 3) == validation.range_within(1, 3, 1, 3) == agrees
    assert validation.within(1, 3, 0.9, 2) == validation.range_within(1, 3, 0.5, 1) == partly
    assert validation.within(1, 3, 0.9, 3.1) == validation.range_within(1, 3, 0.1, 0.9) == disagrees
    assert validation.range_within(1, 3, 0.5, 4) == partly
    assert validation.close((1.09, 1.0), (0.91, 1.0)) == agrees
    assert validation.close((1.11, 1.0), (0.91, 1.0)) == partly
    assert validation.sign(-0.1, 1) == disagrees


def test_every_row_that_does_not_agree_has_its_assumptions():
    """A number has them once, at its first row."""
    noted = {row["row"] for row in WITH_ASSUMPTIONS if row["assumptions"]}
    assert {row["row"] for row in WITH_ASSUMPTIONS} == {row[0] for row in PAGE if row[0][0] in "MA"}
    for row in WITH_ASSUMPTIONS:
        if "disagrees" in row["verdict"] or "partly" in row["verdict"]:
            assert row["row"] in noted, row


def test_the_readme_repeats_rows_of_the_pages_and_counts_all_of_them():
    """A row with two verdicts counts by the first, which is that of the default."""
    pages = {(row[0], *row[2:5]) for row in (*PAGE, *rows(EXPLANATION / "verification.md"))}
    assert {(row[0], *row[2:]) for row in SHORT} <= pages
    verdicts = [row[4] for row in PAGE if row[0][0] in "MA" and row[4] != "fitted"]
    counts = Counter(verdict.split()[0].strip("*,") for verdict in verdicts)
    stated = re.search(r"Of all (\d+) comparisons.*?(\d+) agree, (\d+) .*? (\d+) disagree", README)
    assert [*map(int, stated.groups())] == [
        len(verdicts), counts["agrees"], counts["partly"], counts["disagrees"],
    ]  # fmt: skip


CHOICES = {choice.name: choice for choice in (DEFAULT, *ALTERNATIVES)}
PLAIN, WANG, BOTH = "drag supercritical", "lift wang", "drag supercritical, lift wang"


def worst_of_tables_4_5(choice):
    paths = {row: tables_4_5.kick(row, tables_4_5.fit(choice), choice) for row in
             tables_4_5.PREDICTED}  # fmt: skip
    return 100 * max(abs(path.range / row.experiment - 1) for row, path in paths.items())


STATED = [
    (PAPER, r"difference of the three is (\S+) %.*?, (\S+) % with.*?, and (\S+) % with",
     lambda: [worst_of_tables_4_5(CHOICES[name]) for name in (DEFAULT.name, PLAIN, BOTH)]),
    (README, r"interval, (\S+) to (\S+) m", lambda: tables_4_5.fit(DEFAULT).middle),
    (PAPER, r"The curve is (\S+) m, and (\S+) m with .*? it is (\S+) and (\S+) m",
     lambda: [fig_10.curve(fig_10.flights(CHOICES[name])["right-low"])
              for name in (DEFAULT.name, PLAIN, WANG, BOTH)]),
    (PAPER, r"takes (\d+), (\d+) and (\d+) with .*?, (\d+), (\d+) and (\d+) with the default",
     lambda: [item.ours for name in (DEFAULT.name, PLAIN)
              for item in fig_15.varying(CHOICES[name])]),
    (PAPER, r"minus knee, (\S+) to (\S+) deg, and e, (\S+) to (\S+)\. That",
     lambda: [number.value for number in numbers_of(table_2.items()[0].why)][:4]),
    (PAPER, r"gives more than (\S+) N s in case \(c\)",
     lambda: [kd.normal_impulse(1.0, 0.8, table_2.search(1.0)[1].max(axis=0)[2], 0.45)]),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("page", "pattern", "values"), STATED, ids=[row[1] for row in STATED])
def test_a_sentence_states_the_numbers_of_the_items(page, pattern, values):
    stated = re.search(pattern, page)
    assert stated, pattern
    for text, value in zip(stated.groups(), values(), strict=True):
        (shown,) = numbers_of(text)
        assert shown.agrees(Number("", float(value), 0.0)), (text, value)


G = 9.81


class Limb(NamedTuple):
    length: float
    mass: float
    inertia: float
    centre: float  # from the proximal joint


TABLE_1 = {
    "thigh": Limb(0.371, 7, 0.08, 0.371 / 2),
    "shank": Limb(0.443, 3, 0.049, 0.443 / 2),
    "foot": Limb(0.145, 1, 0.0018, 0.145 / 2),
}
TABLE_6 = {
    "thigh": Limb(0.4, 1.712, 0.02305, 0.2),
    "shank": Limb(0.396, 1.074, 0.01413, 0.198),
    "foot": Limb(0.22, 0.57, 0.00055, 0.073),
}
RADIUS = {"thigh": 0.07, "shank": 0.05, "foot": 0.03}
"""Of the cylinders whose inertia about their axes the human leg has [m]."""

RANGE_DEG = {"hip": (-30, 125), "knee": (0, 140), "ankle": (-20, 50)}

# Anderson, Madigan & Nussbaum 2007, Table 3, men 18-25: the largest torque is c1 times body
# weight times height; hip extension, knee extension, plantar flexion.
HUMAN_EFFORT = [c1 * 75 * G * 1.75 for c1 in (0.161, 0.163, 0.095)]
# RBDL's GymnastWholeBody, and 1160 deg/s at the knee
HUMAN_VELOCITY = [9.18043, math.radians(1160), 17.2746]


def outstretched(limbs):
    """Weight torque of, and reach from, hip, knee and ankle of a leg that is level."""
    torques, reaches = [], []
    for k in range(3):
        torque, reach = 0.0, 0.0
        for limb in list(limbs.values())[k:]:
            torque += G * limb.mass * (reach + limb.centre)
            reach += limb.length
        torques.append(torque)
        reaches.append(reach)
    return np.array(torques), np.array(reaches)


TORQUE, REACH = outstretched(TABLE_6)
LEGS = {  # file: leg, table, limits, and the digits that these have in the file
    "leg_human.urdf": (kd.Leg.human(), TABLE_1, HUMAN_EFFORT, HUMAN_VELOCITY, (0.5, 0.05)),
    "leg_testbed.urdf": (kd.Leg.testbed(), TABLE_6, 2 * TORQUE, 2 * 2.2 / REACH, (1e-3, 1e-3)),
}
each_leg = pytest.mark.parametrize("name", LEGS)


def numbers(element, key):
    return [float(text) for text in element.get(key).split()]


@each_leg
def test_every_number_of_the_table_is_in_the_file(name):
    text = shipped_urdf(name).read_text()
    head = re.search(r"<!--(.*?)-->", text, re.DOTALL).group(1)
    assert ("Table 1" if "human" in name else "Table 6") in head
    root = ElementTree.fromstring(text)
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    for (limb, table), proximal, distal in zip(
        LEGS[name][1].items(), ("hip", "knee", "ankle"), ("knee", "ankle", "toe_fixed"), strict=True
    ):
        along = np.array([1, 0, 0] if limb == "foot" else [0, 0, -1])
        link = root.find(f"link[@name='{limb}']")
        inertial = link.find("inertial")
        tensor = inertial.find("inertia")
        assert joints[proximal].find("child").get("link") == limb
        assert float(inertial.find("mass").get("value")) == table.mass
        assert numbers(inertial.find("origin"), "xyz") == pytest.approx(table.centre * along)
        assert numbers(joints[distal].find("origin"), "xyz") == pytest.approx(table.length * along)
        radius = RADIUS[limb]
        if name != "leg_human.urdf":  # drawn by meshes
            drawn = link.findall("visual")[1].find("geometry/cylinder")
            assert float(drawn.get("length")) == table.length
            radius = float(drawn.get("radius"))
        axial, other = ("ixx", "izz") if limb == "foot" else ("izz", "ixx")
        assert float(tensor.get("iyy")) == float(tensor.get(other)) == table.inertia
        assert float(tensor.get(axial)) == pytest.approx(table.mass * radius**2 / 2, rel=1e-4)
        assert [tensor.get(key) for key in ("ixy", "ixz", "iyz")] == ["0", "0", "0"]


@each_leg
def test_limits_are_derived_as_the_header_says(name):
    leg, _, effort, velocity, digits = LEGS[name]
    assert leg.joint_names == tuple(RANGE_DEG)
    for joint, span in RANGE_DEG.items():
        assert leg.joint_range(joint) == pytest.approx(np.radians(span), rel=closed_form(10))
    assert leg.effort_limit == pytest.approx(effort, abs=digits[0])
    assert leg.velocity_limit == pytest.approx(velocity, abs=digits[1])


@each_leg
@pytest.mark.parametrize(
    ("joint", "frame", "moves"),
    [
        ("hip", "shank", (1, 0, 0)),  # the knee goes forward
        ("knee", "foot", (-1, 0, 0)),  # the heel goes back
        ("ankle", "toe", (0, 0, -1)),  # the toe goes down
    ],
)
def test_flexion_is_positive_from_a_straight_leg(name, joint, frame, moves):
    leg = kd.Leg.from_urdf(shipped_urdf(name), frame)
    straight = leg.posture(np.zeros(3))
    velocity = straight.jacobian[:, leg.velocity_index(joint)]
    assert velocity / np.linalg.norm(velocity) == pytest.approx(moves, abs=closed_form())
    if frame == "toe":
        thigh, shank, foot = (limb.length for limb in LEGS[name][1].values())
        assert straight.contact_point == pytest.approx([foot, 0, -thigh - shank], abs=closed_form())
        assert LEGS[name][0].frame == "toe"
