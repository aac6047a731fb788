"""Every option that a message of `kickdyn plan` names is accepted as it is printed."""

import re

import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.plan_command import plan
from kickdyn.cli.plan_suggestions import _rounded_away


def run(words):
    """What `kickdyn plan` prints, or the message of its error."""
    ended = CliRunner().invoke(plan, words.split())
    assert ended.exception is None or isinstance(ended.exception, kd.InvalidInput)
    return str(ended.exception or " ".join(ended.output.split()))


@pytest.mark.parametrize(
    ("given", "replaced", "reason"),
    [
        (
            "--distance 20 --height 1 --time 1 --leg g1 --friction 0.1",
            "--beside 9:-3",
            "spin faster than 100",
        ),
        (
            "--distance 12 --height 1 --no-limits",
            "--apex 0.2",
            "no flight to the target stays so low",
        ),
        ("--distance 30 --no-limits", "--time 0.05", "start faster than 343 m/s"),
        ("--distance 20 --no-limits", "--launch-speed 5", "starts more slowly"),
        ("--distance 8 --pass carpet", "--time 60", "a slower ball stops before the target"),
    ],
)
def test_what_is_in_reach_is_accepted_as_printed(given, replaced, reason):
    said = run(f"{given} {replaced}")
    assert reason in said
    option = re.search(r"; (--\S+ \S+) is in reach$", said)[1]
    assert option.split()[0] == replaced.split()[0]
    assert "The ball reaches the target" in run(f"{given} {option}")


def test_what_the_leg_cannot_reach_is_named_as_such():
    assert run("--distance 30 --time 0.05").endswith("but beyond the limits of the leg")


def test_a_leg_in_a_plane_is_told_first():
    said = run("--distance 20 --height 1 --time 1 --beside 9.15:3")
    assert said.startswith("leg_human cannot give this spin: its foot moves in a plane only")


def test_where_nothing_is_near_no_option_is_named():
    said = run("--distance 2000 --time 5")
    assert said == (
        "the goal is out of reach: the ball would have to start faster than 343 m/s; the farthest "
        "is 285.9 m, at 343 m/s"
    )


def test_a_wall_names_the_options_that_clear_it():
    flat = "--distance 20 --height 1 --wall 9.15:1.9"
    said = run(f"{flat} --time 0.7 --no-limits")
    assert said.endswith(" from its edge: use --over 9.15:2 in place of --time")
    assert "clears the wall by 0.1 m" in run(f"{flat} --over 9.15:2")
    high = "--distance 20 --height 1 --wall 9.15:5:0.4 --leg g1 --no-limits --time 1"
    assert run(high).endswith(": use --over 9.15:5.1 in place of --time, or --beside 9.15:0.41")
    assert run("--distance 8 --time 2 --pass carpet --wall 4:1").endswith("from its edge")


def test_a_height_of_the_ball_with_no_body_under_the_ground():
    said = run("--distance 30 --height 2 --time 1.5")
    assert "under the ground at the impact: foot" in said
    height = re.search(r"With (--ball-height \S+), no body is under the ground\.", said)[1]
    assert "under the ground" not in run(f"--distance 30 --height 2 --time 1.5 {height}")


@pytest.mark.parametrize("goal", ["--distance 50 --time 2", "--distance 40 --left 5 --time 1.2"])
def test_what_is_within_the_limits_is_met_as_printed(goal):
    said = run(goal)
    options = re.search(r"Within the limits of the leg is, for instance, (--.*?)\. ", said)[1]
    assert "The ball reaches the target" in run(options)


def test_a_leg_that_cannot_kick_in_the_direction_is_named_no_distance(tmp_path):
    """A hinge without limits, whose foot can strike the ball but not in the planned direction."""
    pytest.importorskip("mujoco")
    file = tmp_path / "hinge.xml"
    file.write_text("""<mujoco><worldbody><body><joint name="hip" axis="0 1 0"/>
        <geom type="capsule" size="0.05" fromto="0 0 0 0 0 -0.4"/><site name="toe" pos="0 0 -0.4"/>
        </body></worldbody></mujoco>""")
    said = run(f"--leg {file} --frame toe --distance 2 --time 0.5")
    assert "The goal is beyond the limits of the leg." in said
    assert "for instance" not in said


def test_a_wall_beyond_what_is_within_the_limits_is_left_out():
    said = run("--distance 10 --height 1 --wall 9.15:3")
    assert said.count(", without --height and --wall. ") == 1
    options = re.search(r"Within the limits of the leg is, for instance, (--.*?), without", said)[1]
    assert "The ball reaches the target" in run(options)


def test_back_spin_towards_a_target_at_the_side_is_named():
    goal = "--distance 20 --height 1 --left 3 --time 1"
    said = run(f"{goal} --spin 0,-20,0")
    assert said.startswith("leg_human cannot give this spin")
    (option,) = re.findall(r"this spin is (--spin \S+)$", said)
    assert option == "--spin 2.96681,-19.7787,0"
    assert "The ball reaches the target" in run(f"{goal} {option}")
    for other in ("--spin 0,-20,5", "--spin 0,-20,0 --wind 0,3,0"):
        assert "this spin is" not in run(f"{goal} {other}")


def test_values_are_rounded_away_from_what_was_asked_for():
    assert list(_rounded_away(0.99437, 3.0)) == [0.9943, 0.994, 0.99]
    assert list(_rounded_away(-0.99437, -3.0)) == [-0.9943, -0.994, -0.99]
    assert list(_rounded_away(0.10302, 0.05)) == [0.1031, 0.104, 0.11]
    assert list(_rounded_away(19.441, 5.0)) == [19.45, 19.5, 20.0]
    assert list(_rounded_away(0.0, 1.0)) == [0.0, 0.0, 0.0]
