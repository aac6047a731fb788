import math

import click
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.leg_options import LegOptions, leg_options
from kickdyn.robot.urdf_file import shipped_urdf

FOURBAR = str(shipped_urdf("leg_fourbar.urdf"))
BOLT = ("--leg", "bolt")
LOOP = "shank_pin:rocker_b_tip"


def loaded(*arguments):
    """The leg of a command line, and what it writes to standard error."""
    legs = []

    @click.command()
    @leg_options
    @click.option("--speed", default=1.0)
    def command(leg_options: LegOptions, speed: float) -> None:
        legs.append(leg_options.load())

    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    return legs[0], result.stderr


def test_the_human_leg_is_the_default():
    leg, said = loaded()
    assert (leg.name, leg.frame, leg.constraints, said) == ("leg_human", "toe", None, "")


def test_loops_close_what_a_file_cuts_open():
    leg, said = loaded("--leg", FOURBAR, "--loop", LOOP)
    assert (leg.constraints.loops, said) == ((("shank_pin", "rocker_b_tip"),), "")
    _, said = loaded("--leg", FOURBAR)
    assert said.startswith("warning: shank_pin and rocker_b_tip are at one place at q = 0")
    assert said.endswith(f"(--loop {LOOP})\n")


def test_a_robot_on_a_support_has_both_legs_and_a_floating_base():
    leg, said = loaded("--leg", "bolt", "--support", "FL_FOOT", "--frame", "FR_FOOT")
    assert [s.frame for s in leg.constraints.supports] == ["FL_FOOT"]
    assert said == "".join(f"warning: {line}\n" for line in leg.warnings)
    assert leg.joint_names[0] == "root_joint"
    assert leg.nv == 12


def test_joints_are_locked_in_degrees_or_metres(tmp_path):
    leg, said = loaded("--lock", "ankle=-10", "--lock", "knee=30")
    assert (leg.joint_names, said) == (("hip",), "")
    human = kd.Leg.human()
    q = human.configuration({"knee": math.radians(30), "ankle": math.radians(-10)})
    assert leg.posture([0.0]).contact_point == pytest.approx(human.posture(q).contact_point)
    leg, _ = loaded("--leg", "g1", "--lock", "right_knee_joint=40")
    assert leg.nv == 5
    path = tmp_path / "slide.urdf"
    path.write_text(
        human.file.text.replace('name="ankle" type="revolute"', 'name="ankle" type="prismatic"')
    )
    leg, _ = loaded("--leg", str(path), "--lock", "ankle=0.25")
    assert leg.posture([0.0, 0.0]).contact_point[1] == pytest.approx(0.25)  # its axis is y


def test_stiff_joints():
    assert loaded("--stiff", "ankle", "--stiff", "knee")[0].stiff_joints == ("ankle", "knee")


def test_supports_of_a_file_float_its_base():
    with pytest.raises(kd.InvalidInput, match="the base floats and has no mass"):
        loaded("--leg", str(shipped_urdf("leg_human.urdf")), "--support", "base")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--lock", "knee"), r"--lock is 'knee': it must be JOINT=VALUE \[deg; m\]"),
        (("--lock", "=3"), "--lock is '=3': it must be JOINT=VALUE"),
        (("--lock", "knee=x"), "--lock is 'knee=x': it must be JOINT=VALUE"),
        (("--lock", "knee=nan"), "--lock is 'knee=nan': it must be JOINT=VALUE"),
        (("--support", "toe:-1"), "--support is 'toe:-1': .* friction of at least 0"),
        (("--lock", "knee=1", "--lock", "knee=2"), "--lock is 'knee=2': .* once for each joint"),
        (
            ("--lock", "ankle=500"),
            "ankle at 500 deg is outside its range -20 to 50 deg: it cannot be locked there$",
        ),
        (("--lock", "kne=1"), "joint 'kne' is unknown: did you mean 'knee'"),
        (("--loop", "a-b"), "--loop is 'a-b': it must be two frames, A:B"),
        (("--loop", "toe:"), "--loop is 'toe:': it must be two frames, A:B"),
        (("--loop", "toe:foot"), "loop toe - foot joins a body to itself"),
        (("--loop", "toe:tow"), "frame 'tow' is unknown"),
        (("--stiff", "toe"), "joint 'toe' is unknown"),
        ((*BOLT, "--support", "toe"), "support toe is on the kicking limb"),
        ((*BOLT, "--support", "tow"), "frame 'tow' is unknown"),
        (("--support", "left_foot"), "^frame 'left_foot' is unknown: did you mean 'foot'"),
        (("--support", "base"), "inertia of leg_human at this posture is not positive definite"),
    ],
)
def test_bad_options_are_refused(arguments, said):
    with pytest.raises(kd.InvalidInput, match=said):
        loaded(*arguments)
