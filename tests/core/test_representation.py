"""What answers show of themselves, in a terminal and in Jupyter."""

import copy
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from planned_motions import swinging

import kickdyn as kd
from kickdyn.core.representation import ReprMixin, distance_in_words, format_value


class Named(ReprMixin):
    def __init__(self, *rows):
        self._all = rows

    def _rows(self):
        return self._all


SCENE = Path(__file__).resolve().parents[2] / "scenes" / "paper_kick.toml"
POSTURE = kd.Leg.human().posture(np.radians([5, 10, -5]))
TOUCH = kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
HIT = kd.strike(POSTURE, POSTURE.joint_velocity([10, 0, 5]), kd.Ball(), TOUCH)
LAUNCH = kd.BallState((0, 0, 0.11), (12, 9, 8))
COURSE = kd.follow(LAUNCH, kd.Ball(), None, kd.Ground(surface="wet-grass"))
GOAL = kd.Goal((20, 0, 0), time=1.5)
ANSWERS = {
    "Leg": POSTURE.leg,
    "Impact": HIT,
    "Sensitivity": HIT.sensitivity(),
    "Collision": kd.collide(POSTURE, HIT.v_before, kd.Ball(), TOUCH, tol=1e-6),
    "Flight": kd.fly(LAUNCH, kd.Ball()),
    "Course": COURSE,
    "Launch": kd.plan_launch(GOAL, kd.Ball()),
    "KickPlan": kd.plan_kick(POSTURE.leg, GOAL, kd.Ball()),
    "Pass": kd.plan_pass(kd.Goal(8, time=2.0), kd.Ball()),
}
NOUNS = {
    "Posture": POSTURE,
    "Ball": kd.Ball(),
    "Contact": kd.Contact((2, 0, 1), 0.8, 0.4, offset=(0, 0, 0.01)),
    "Air": kd.Air(lift=None),
    "Ground": kd.Ground(surface="turf"),
    "Plane": kd.Plane((5, 0, 0), (-1, 0, 0)),
    "Goal": kd.Goal(20, over=(9.15, 2), beside=(9.15, 1)),
    "Scene": kd.load_scene(SCENE),
}
ANSWERS |= NOUNS
ANSWERS["Motion"] = swinging().motion


@pytest.mark.parametrize("name", ANSWERS)
def test_every_answer_shows_a_small_table(name):
    page = ElementTree.fromstring(f"<p>{ANSWERS[name]._repr_html_()}</p>")
    assert page.findtext("table/caption/b") == name
    rows = [["".join(cell.itertext()) for cell in row] for row in page.iter("tr")]
    assert 2 <= len(rows) <= 24
    assert all(label for label, _, _ in rows)
    text = repr(ANSWERS[name])
    assert text.startswith(name)
    assert "array(" not in text
    lines = [line for line in text.splitlines() if not line.startswith("  warning")]
    assert max(map(len, lines)) < (150 if name in NOUNS else 100)


@pytest.mark.parametrize("name", ["Uncertainty", "Simulation"])
def test_budgets_show_what_they_print(name):
    budget = {
        "Uncertainty": lambda: HIT.uncertainty(v=0.1),
        "Simulation": lambda: kd.simulate(kd.load_scene(SCENE), tolerance=1.0),
    }[name]()
    assert repr(budget) == str(budget)
    assert "<script" not in budget._repr_html_()
    assert ElementTree.fromstring(budget._repr_html_()).text == str(budget)


def test_the_numbers_are_the_answers_own():
    text = repr(HIT)
    assert f"{HIT.effective_mass:.4g} kg" in text
    assert f"({HIT.impulse[0]:.4g}, 0, {HIT.impulse[2]:.4g}) N s" in text
    assert "worst joint, ankle" in text


def test_names_are_escaped():
    page = Named(("<script>alert(1)</script>", "<b>&", "m"))._repr_html_()
    assert "<script>" not in page
    assert "<b>&" not in page
    assert "&lt;script&gt;" in page


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (-0.0, "0"),
        (np.float64(1 / 3), "0.3333"),
        (np.array([1.0, -0.0, 2.5e-7]), "(1, 0, 2.5e-07)"),
        (np.array([1.0, -7e-23, 2e-11]), "(1, 0, 2e-11)"),
        (np.array([3e-17, 0.0]), "(3e-17, 0)"),
        (True, "yes"),
        (np.False_, "no"),
        (7, "7"),
        (float("inf"), "inf"),
    ],
)
def test_values(value, text):
    assert format_value(value) == text


def test_rounding_is_not_shown():
    """The axis of a joint that gives way takes nothing: computed, some 1e-17."""
    carried, along = np.array([2.8, 0, -0.9, 0, 3e-17, 0]), np.array([0, 0, 0, 0, -7e-23, 0])
    load = kd.JointLoad("ankle", carried, along, 460.0, 1e-13)
    assert not re.search(r"e-[12]\d", load._repr_html_() + repr(load))


@pytest.mark.parametrize("name", ["Posture", "Ball", "Contact", "Air", "Ground", "Plane", "Goal"])
def test_what_an_error_may_quote_is_a_line(name):
    assert len(repr(NOUNS[name]).splitlines()) == 1


def test_a_load_shows_its_peak_and_what_is_along_the_axis():
    loads = kd.joint_loads(HIT, contact_time=0.01)
    assert list(loads) == list(POSTURE.leg.joint_names)
    assert f"peak {loads['knee'].peak_force:.4g} N)" in repr(loads["knee"])
    assert "along the axis" not in repr(loads)
    geared = POSTURE.leg.with_armature({"knee": 0.05})
    hit = kd.strike(geared.posture(POSTURE.q), HIT.v_before, kd.Ball(), TOUCH)
    assert "N s along" not in repr(kd.joint_loads(hit)["hip"])


def test_a_robots_posture_shows_the_joints_that_moved():
    robot = kd.Leg.from_robot("g1")
    text = repr_rows(robot.posture(robot.configuration({robot.joint_names[0]: 0.3})))
    assert text[1][0] == robot.joint_names[0]
    assert len(text) == 4
    bent = robot.posture(robot.configuration(dict.fromkeys(robot.joint_names[:12], 0.1)))
    assert ("and", "4 joints more", "") in repr_rows(bent)


def test_a_kick_beyond_what_the_joints_can_do_says_so():
    leg = POSTURE.leg
    v = np.array([6.6, -14.5, 6.6])
    within = kd.strike(leg.posture(POSTURE.q), v, kd.Ball(), TOUCH)
    assert (within.warnings, POSTURE.warnings) == ((), ())
    assert "warning" not in repr(within) + POSTURE._repr_html_()
    fast = f"knee at {abs(HIT.v_before[1]) / leg.velocity_limit[1]:.1%}".replace("%", " %")
    collided = kd.collide(leg.posture(POSTURE.q), HIT.v_before, kd.Ball(), TOUCH)
    for answer in (HIT, collided):
        assert re.findall("warning +(.*)", repr(answer)) == [f"{fast} of its speed limit"]
    bent = np.radians([-40, -5, 60])
    beyond = kd.strike(
        leg.posture(bent), leg.posture(bent).joint_velocity([30, 0, 15]), kd.Ball(), TOUCH
    )
    said = re.findall("warning +(.*)", repr(beyond))
    assert said[0] == "hip at -40 deg is outside its range -30 to 125 deg"
    assert said[1].startswith("knee at -5 deg")
    assert said[2:] == [
        "ankle at 60 deg is outside its range -20 to 50 deg",
        "and 3 more: see `warnings` (of a command: --json)",
    ]
    assert beyond.posture.warnings == beyond.warnings[:3]
    assert "knee at -5 deg" in leg.posture(bent)._repr_html_()


def repr_rows(answer):
    return list(answer._rows())


def test_states_of_a_ball():
    assert repr(kd.BallState((1, 2, 3), time=0.5)) == (
        "BallState(position=(1, 2, 3) m, velocity=(0, 0, 0) m/s, spin=(0, 0, 0) rad/s, time=0.5 s)"
    )
    many = ANSWERS["Flight"].sample([0.0, 0.25])
    assert repr(many) == "BallState(2 times, 0 to 0.25 s)"


def test_contacts_of_the_same_values_are_equal():
    one, other = kd.Contact((0, 0, 5), 0.8), kd.Contact([0.0, 0.0, 1.0], 0.8, offset=None)
    assert one == other
    assert hash(one) == hash(other)
    assert one != kd.Contact((0, 0, 1), 0.8, offset=(0, 0, 0))
    assert one != kd.Contact((0, 1, 0), 0.8)
    assert one != 0.8


def test_states_of_the_same_values_are_equal():
    one, other = (kd.BallState(velocity=np.ones((2, 3))) for _ in range(2))
    assert one == other == copy.deepcopy(one)
    assert hash(one) == hash(other)
    assert one != kd.BallState(velocity=(1, 1, 1))
    assert kd.BallState((-0.0, 0, 0)) == kd.BallState((0.0, 0, 0))


@pytest.mark.parametrize(
    ("distance", "words"),
    [
        (0.0, "less than a micrometre"),
        (2.8e-17, "less than a micrometre"),
        (1e-6, "0.001 mm"),
        (4.56e-4, "0.46 mm"),
        (0.0456, "0.046 m"),
        (12.3, "12 m"),
    ],
)
def test_distances_for_people(distance, words):
    assert distance_in_words(distance) == words
