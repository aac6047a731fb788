"""Models of gymnasium, random ones against free bodies tied by joints, and settings one by one.

A free body has six velocities, a joint ties two bodies, and a rotor has a rate of its own.
"""

import sys
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.robot.leg import NO_DRIVES
from kickdyn.robot.mjcf_file import quiet_mujoco

MODELS = Path(find_spec("gymnasium").origin).parent / "envs" / "mujoco" / "assets"


def written(tmp_path, body, more=""):
    """The path of a model with these bodies, and sections before them."""
    file = tmp_path / "robot.xml"
    file.write_text(f'<mujoco model="robot">{more}<worldbody>{body}</worldbody></mujoco>')
    return file


@pytest.mark.parametrize(
    ("name", "frame", "mass", "nv"),
    [
        ("humanoid.xml", "right_foot", 42.116, 17),
        ("half_cheetah.xml", "bfoot", 14.0, 9),  # <compiler settotalmass="14"/>
        ("hopper.xml", "foot", 15.820, 6),
        ("walker2d_v5.xml", "foot", 23.677, 9),
        ("ant.xml", "aux_1", 0.911, 8),
        ("swimmer.xml", "back", 106.814, 5),
        ("pusher_v5.xml", "tips_arm", 13.673, 7),  # without the objects on the table
        ("inverted_pendulum.xml", "pole", 15.491, 2),
    ],
)
def test_models_of_gymnasium(name, frame, mass, nv):
    leg = kd.Leg.from_mjcf(MODELS / name, frame)
    assert leg.nv == nv
    assert sum(body.mass for body in leg.model.inertias) == pytest.approx(mass, abs=5e-4)
    posture = leg.posture(leg.configuration())
    assert posture.condition < 2e3
    if name not in ("humanoid.xml", "ant.xml", "pusher_v5.xml"):  # a free joint, objects
        check_inertia_of_mujoco(MODELS / name, leg, posture)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_the_humanoid_has_the_inertia_that_pinocchios_reader_gives_it(base):
    """That one merges the joints of a body, in the order of the file, and keeps the free joint."""
    leg = kd.Leg.from_mjcf(MODELS / "humanoid.xml", "right_foot", base=base)
    theirs = pin.buildModelFromMJCF(str(MODELS / "humanoid.xml"))
    draw = np.random.default_rng(0)
    for _ in range(5):
        angles = draw.uniform(-1, 1, 17)
        q = pin.neutral(theirs)
        q[7:] = angles
        inertia = pin.crba(theirs, theirs.createData(), q)
        posture = leg.posture(np.concatenate([pin.neutral(leg.model)[:-17], angles]))
        np.testing.assert_allclose(
            posture.inertia, inertia[-leg.nv :, -leg.nv :], rtol=0, atol=1e-12
        )


def test_limits_of_the_humanoid_come_from_joints_and_actuators():
    leg = kd.Leg.from_mjcf(MODELS / "humanoid.xml", "right_foot")
    knee = leg.velocity_index("right_knee")
    assert leg.joint_range("right_knee") == pytest.approx(np.radians([-160, -2]))
    assert leg.effort_limit[knee] == 200 * 0.4  # gear times ctrlrange
    assert leg.model.armature[knee] == 0.006
    assert np.isinf(leg.velocity_limit).all()


# --- random models ---


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def turned(quaternion):
    """The rotation of a quaternion (wxyz)."""
    w, *xyz = np.asarray(quaternion) / np.linalg.norm(quaternion)
    return np.eye(3) + 2 * w * skew(xyz) + 2 * skew(xyz) @ skew(xyz)


def about(axis, angle):
    """The rotation about a unit axis (Rodrigues)."""
    return np.eye(3) + np.sin(angle) * skew(axis) + (1 - np.cos(angle)) * skew(axis) @ skew(axis)


def random_bodies(draw, kinds, floating):
    """Numbers of a tree of bodies: each with up to three joints, on a body before it."""
    bodies = []
    for number, joints in enumerate(kinds):
        a, b, c = draw.uniform(0.001, 0.05, 3)
        bodies.append(
            {
                "parent": int(draw.integers(number)) if number else -1,
                "pos": draw.uniform(-0.4, 0.4, 3),
                "quat": draw.normal(size=4),
                "mass": draw.uniform(0.2, 8.0),
                "centre": draw.uniform(-0.2, 0.2, 3),
                "axes": draw.normal(size=4),
                "moments": (a + b, b + c, c + a),
                "joints": [
                    {
                        "kind": kind,
                        "pos": draw.uniform(-0.2, 0.2, 3),
                        "axis": draw.normal(size=3),
                        "ref": draw.uniform(-0.5, 0.5),
                        "armature": draw.choice([0.0, draw.uniform(0.01, 0.5)]),
                    }
                    for kind in joints
                ],
            }
        )
    if floating:
        bodies[0]["joints"] = [{"kind": "free", "armature": 0.0}]
    return bodies


def as_xml(bodies, number):
    """The element of a body and all that it carries."""

    def text(values):
        return " ".join(f"{value:.17g}" for value in np.atleast_1d(values))

    body, name = bodies[number], f"body{number}"
    lines = [f'<body name="{name}" pos="{text(body["pos"])}" quat="{text(body["quat"])}">']
    for k, joint in enumerate(body["joints"]):
        more = "".join(
            f' {key}="{text(joint[key])}"'
            for key in ("pos", "axis", "ref", "armature")
            if key in joint and not (joint["kind"] == "ball" and key in ("axis", "ref"))
        )
        lines.append(f'<joint name="{name}_{k}" type="{joint["kind"]}"{more}/>')
    lines.append(
        f'<inertial pos="{text(body["centre"])}" quat="{text(body["axes"])}" '
        f'mass="{text(body["mass"])}" diaginertia="{text(body["moments"])}"/>'
    )
    lines += [as_xml(bodies, k) for k, other in enumerate(bodies) if other["parent"] == number]
    return "".join([*lines, "</body>"])


def tied_bodies(bodies, leg, q):
    """Velocities that unit impulses at the origin of the last body give that point, and rotors.

    Returns the matrix of the point's velocities, shape `(3, 3)`, and the rates of the joints of one
    degree of freedom by name.
    """
    values = {}
    for name, joint in zip(leg.joint_names, list(leg.model.joints)[1:], strict=True):
        values[name] = q[joint.idx_q : joint.idx_q + joint.nq]
    n = len(bodies)
    places, mass, ties, motions, rotors, columns = [], np.zeros((6 * n, 6 * n)), [], [], [], []
    for number, body in enumerate(bodies):
        turn, origin = places[body["parent"]] if body["parent"] >= 0 else (np.eye(3), np.zeros(3))
        place = origin + turn @ body["pos"]
        turn = turn @ turned(body["quat"])
        motion = []  # velocity at the world's origin, angular velocity; of each rate
        for k, joint in enumerate(body["joints"]):
            name = f"body{number}_{k}"
            value = values[name]
            if joint["kind"] == "free":
                place, turn = value[:3], turned([value[6], *value[3:6]])
                motion += list(np.eye(6))
                rotors += 6 * [0.0]
                columns += 6 * [""]
                continue
            anchor = place + turn @ joint["pos"]
            axis = joint["axis"] / np.linalg.norm(joint["axis"])
            if joint["kind"] == "slide":
                motion.append(np.concatenate([turn @ axis, np.zeros(3)]))
                place = place + turn @ axis * (value[0] - joint["ref"])
                columns.append(name)
            elif joint["kind"] == "hinge":
                along = turn @ axis
                motion.append(np.concatenate([np.cross(anchor, along), along]))
                turn = turn @ about(axis, value[0] - joint["ref"])
                place = anchor - turn @ joint["pos"]
                columns.append(name)
            else:
                turn = turn @ turned([value[3], *value[:3]])
                motion += [np.concatenate([np.cross(anchor, a), a]) for a in turn.T]
                place = anchor - turn @ joint["pos"]
                columns += 3 * [""]
            rotors += (3 if joint["kind"] == "ball" else 1) * [joint["armature"]]
        places.append((turn, place))
        axes = turn @ turned(body["axes"])
        moments = axes @ np.diag(body["moments"]) @ axes.T
        centre = place + turn @ body["centre"]
        at = slice(6 * number, 6 * number + 6)
        # of a twist at the world's origin
        shift = np.block([[np.eye(3), -skew(centre)], [np.zeros((3, 3)), np.eye(3)]])
        inertia = np.zeros((6, 6))
        inertia[:3, :3], inertia[3:, 3:] = body["mass"] * np.eye(3), moments
        mass[at, at] = shift.T @ inertia @ shift
        tie = np.zeros((6, 6 * n))
        tie[:, at] = np.eye(6)
        if body["parent"] >= 0:
            tie[:, 6 * body["parent"] : 6 * body["parent"] + 6] -= np.eye(6)
        ties.append(tie)
        motions.append(np.array(motion).reshape(-1, 6).T)
    rates = len(rotors)
    moved = np.zeros((6 * n, rates))
    at = 0
    for number, motion in enumerate(motions):
        moved[6 * number : 6 * number + 6, at : at + motion.shape[1]] = motion
        at += motion.shape[1]
    tie = np.hstack([np.vstack(ties), -moved])
    inertia = np.zeros((6 * n + rates, 6 * n + rates))
    inertia[: 6 * n, : 6 * n] = mass
    inertia[6 * n :, 6 * n :] = np.diag(rotors)
    system = np.block([[inertia, tie.T], [tie, np.zeros((len(tie), len(tie)))]])
    point = np.zeros((3, len(system)))
    point[:, 6 * n - 6 : 6 * n - 3] = np.eye(3)
    point[:, 6 * n - 3 : 6 * n] = -skew(places[-1][1])
    answer = np.linalg.solve(system, point.T)
    found = answer[6 * n : 6 * n + rates]
    return point @ answer, {name: found[k] for k, name in enumerate(columns) if name}


JOINTS = st.lists(st.sampled_from(["hinge", "slide", "ball"]), min_size=1, max_size=2)


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    kinds=st.lists(JOINTS, min_size=2, max_size=5),
    floating=st.booleans(),
)
def test_random_models_are_bodies_tied_by_joints(tmp_path_factory, seed, kinds, floating):
    # two balls or parallel slides in one body would move nothing between them
    kinds = [joints if "ball" not in joints else ["ball"] for joints in kinds]
    draw = np.random.default_rng(seed)
    bodies = random_bodies(draw, kinds, floating)
    file = written(
        tmp_path_factory.mktemp("model"), as_xml(bodies, 0), '<compiler angle="radian"/>'
    )
    leg = kd.Leg.from_mjcf(file, f"body{len(bodies) - 1}", base="floating" if floating else "fixed")
    q = pin.integrate(leg.model, pin.neutral(leg.model), draw.uniform(-1, 1, leg.nv))
    posture = leg.posture(q)
    expected, rates = tied_bodies(bodies, leg, q)
    digits = 1e-10 * np.abs(expected).max()
    np.testing.assert_allclose(posture.delassus(), expected, rtol=0, atol=digits)
    jump = posture.solve(posture.jacobian.T)
    for name, rate in rates.items():
        index = leg.velocity_index(name)
        np.testing.assert_allclose(jump[index], rate, rtol=0, atol=1e-10 * np.abs(jump).max())
    check_inertia_of_mujoco(file, leg, posture)


def check_inertia_of_mujoco(file, leg, posture):
    """Compare M with MuJoCo's, whose free joint has its linear velocity in world axes."""
    with quiet_mujoco():
        theirs = mujoco.MjModel.from_xml_path(str(file))
    state, turn, q = mujoco.MjData(theirs), np.eye(leg.nv), []
    for joint in list(leg.model.joints)[1:]:
        part = posture.q[joint.idx_q : joint.idx_q + joint.nq]
        if joint.nq == 7:
            turn[:3, :3] = turned([part[6], *part[3:6]])
        q += [*part] if joint.nq == 1 else [*part[:-4], part[-1], *part[-4:-1]]
    state.qpos[:] = q
    mujoco.mj_forward(theirs, state)
    inertia = np.zeros((leg.nv, leg.nv))
    for unit, column in zip(np.eye(leg.nv), inertia, strict=True):
        mujoco.mj_mulM(theirs, state, column, unit)
    np.testing.assert_allclose(
        posture.inertia, turn.T @ inertia @ turn, rtol=0, atol=1e-12 * np.abs(inertia).max()
    )


# --- settings of the format ---

ARM = '<body name="arm"><joint name="j" axis="0 1 0"/>{}</body>'
BALL = '<geom type="sphere" size="0.1" pos="0 0 -1" mass="2"/>'


def arm(tmp_path, body=None, more=""):
    return kd.Leg.from_mjcf(written(tmp_path, body or ARM.format(BALL), more), "arm")


def moment(leg, joint="j"):
    """What a joint moves at 0."""
    index = leg.velocity_index(joint)
    return leg.posture(leg.configuration()).inertia[index, index]


SPHERE = 2 * 1.0 + 2 * 2 * 0.1**2 / 5
"""Moment of the arm's ball about the joint [kg m2]."""


@pytest.mark.parametrize(
    ("more", "times"),
    [
        ("", 1),
        ('<compiler settotalmass="1"/>', 1 / 2),
        ('<compiler boundmass="4"/>', 1 + 2 / SPHERE),  # the mass grows, the moments stay
        ('<compiler boundinertia="3"/>', 1 + (3 - 0.008) / SPHERE),
        ('<compiler coordinate="local" angle="radian"/>', 1),
        ("<default><geom density='7'/><joint armature='2'/></default>", 1 + 2 / SPHERE),
        ('<compiler inertiagrouprange="0 2"/>', 1),
        ('<compiler autolimits="false" fusestatic="true" discardvisual="true"/>', 1),
        ("<contact/><sensor/><keyframe/><custom/><statistic/><visual/><size memory='1G'/>", 1),
    ],
)
def test_a_setting_of_the_compiler(tmp_path, more, times):
    assert moment(arm(tmp_path, more=more)) == pytest.approx(SPHERE * times, rel=1e-12)


@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        ('<inertial pos="0 0 -1" mass="2" diaginertia="0.1 0.2 0.15"/>', 2.2),
        ('<inertial pos="0 0 -1" mass="2" fullinertia="0.1 0.2 0.15 0.01 0.02 0.03"/>', 2.2),
        ('<inertial pos="0 0 -1" mass="2" euler="0 0 90" diaginertia="0.1 0.2 0.15"/>', 2.1),
        (BALL + '<body name="tip" pos="0 0 -1"><geom size="0.1" mass="1"/></body>', SPHERE + 1.004),
        ('<frame pos="0 0 1">' + BALL.replace("-1", "-2") + "</frame>", SPHERE),
        ('<replicate count="2" offset="0 0 0">' + BALL + "</replicate>", 2 * SPHERE),
        ('<geom type="box" size="0.1 0.2 0.3" mass="3"/>', 0.01 + 0.09),
        ('<geom type="cylinder" size="0.2 0.3" mass="1"/>', 0.04 / 4 + 0.36 / 12),
        ('<geom type="ellipsoid" size="0.1 0.2 0.3" mass="5"/>', 0.01 + 0.09),
    ],
)
def test_inertia_of_a_body(tmp_path, inside, expected):
    # of `fullinertia`, MuJoCo 3.3 finds the principal axes to single precision
    digits = 1e-7 if "fullinertia" in inside else 1e-12
    assert moment(arm(tmp_path, ARM.format(inside))) == pytest.approx(expected, rel=digits)


@pytest.mark.parametrize(
    ("joint", "more", "low", "high"),
    [
        ('range="-90 45"', "", -np.pi / 2, np.pi / 4),
        ('range="-1 2"', '<compiler angle="radian"/>', -1, 2),
        ('type="slide" range="-1 2"', "", -1, 2),  # metres, whatever the angles are in
        ('range="-1 2" limited="false"', "", -np.inf, np.inf),
        ("", '<default><joint range="-90 90"/></default>', -np.pi / 2, np.pi / 2),
        ("", "", -np.inf, np.inf),
    ],
)
def test_range_of_a_joint(tmp_path, joint, more, low, high):
    body = f'<body name="arm"><joint name="j" axis="0 1 0" {joint}/>{BALL}</body>'
    assert arm(tmp_path, body, more).joint_range("j") == pytest.approx((low, high))


@pytest.mark.parametrize(
    ("joint", "actuators", "limit"),
    [
        ("", "", np.inf),
        ('actuatorfrcrange="-20 20"', "", 20),
        ('actuatorfrcrange="-30 20"', "", 20),  # the smaller end
        ("", '<motor joint="j" gear="50" ctrlrange="-2 2"/>', 100),
        ("", '<motor joint="j" gear="-50" ctrlrange="-2 2" forcerange="-1 1"/>', 50),
        ("", '<motor joint="j" gear="50"/>', np.inf),
        ("", '<position joint="j" kp="100" forcerange="-7 7" ctrlrange="-1 1"/>', 7),
        ("", '<position joint="j" kp="100" ctrlrange="-1 1"/>', np.inf),
        ("", '<motor joint="j" forcerange="-4 9"/>', 4),
        ("", '<general joint="j" gainprm="3" ctrlrange="-2 2"/>', 6),
        ('actuatorfrcrange="-8 8"', 2 * '<motor joint="j" ctrlrange="-3 3"/>', 6),
        ('actuatorfrcrange="-5 5"', 2 * '<motor joint="j" ctrlrange="-3 3"/>', 5),
    ],
)
def test_limit_of_torque(tmp_path, joint, actuators, limit):
    body = f'<body name="arm"><joint name="j" axis="0 1 0" {joint}/>{BALL}</body>'
    leg = arm(tmp_path, body, f"<actuator>{actuators}</actuator>")
    assert leg.effort_limit.tolist() == [limit]


def test_names(tmp_path):
    """Joints and bodies without a name get one; sites and geoms with a name are frames."""
    inside = '<site name="instep" pos="0.1 0 -1"/><geom name="skin" size="0.1"/>'
    body = (
        '<body name="base"><freejoint/><geom size="0.2"/><body name="arm"><joint/><joint '
        f'axis="1 0 0"/>{inside}<body><joint name="arm_joint3"/>{BALL}</body></body></body>'
    )
    file = written(tmp_path, body)
    leg = kd.Leg.from_mjcf(file, "instep", base="floating")
    assert leg.joint_names == ("root_joint", "arm_joint", "arm_joint2", "arm_joint3")
    assert leg.posture(leg.configuration()).contact_point == pytest.approx([0.1, 0, -1])
    assert kd.Leg.from_mjcf(file, "skin").frame == "skin"
    with pytest.raises(kd.InvalidInput, match=r"frame 'toe' is unknown: .*body3.*instep, skin"):
        kd.Leg.from_mjcf(file, "toe")
    with pytest.raises(kd.InvalidInput, match="frame is None: it must be a str"):
        kd.Leg.from_mjcf(file, None)
    with pytest.raises(kd.InvalidInput, match="frame 'base' is fixed to the base"):
        kd.Leg.from_mjcf(file, "base")


def test_a_joint_that_follows_another_is_a_mimic_joint(tmp_path):
    body = (
        '<body name="a"><joint name="ja" axis="0 1 0" ref="10"/><geom size="0.1" pos="0 0 -1"/>'
        '<body name="b" pos="0 0 -1"><joint name="jb" axis="0 1 0" ref="20"/>'
        '<geom size="0.1" pos="0 0 -1"/></body></body>'
    )
    tie = '<equality><joint joint1="jb" joint2="ja" polycoef="0.1 2 0 0 0"/></equality>'
    file = written(tmp_path, body, tie)
    leg = kd.Leg.from_mjcf(file, "b")
    q = leg.configuration({"ja": 0.5})
    expected = np.radians(20) + 0.1 + 2 * (0.5 - np.radians(10))
    assert q[leg.velocity_index("jb")] == pytest.approx(expected)
    assert leg.posture(q).admissible([1.0, 0.0])[1] == pytest.approx(
        2 * leg.posture(q).admissible([1.0, 0.0])[0]
    )
    # MuJoCo agrees about the place
    theirs = mujoco.MjModel.from_xml_path(str(file))
    state = mujoco.MjData(theirs)
    state.qpos[:] = q
    mujoco.mj_forward(theirs, state)
    assert state.efc_pos[: state.ne] == pytest.approx([0.0], abs=1e-12)
    for more, said in (
        (tie.replace("</e", '<joint joint1="ja" joint2="jb"/></e'), "'ja' mimics 'jb': both must"),
        (tie.replace('"jb"', '"ja"'), "MuJoCo cannot read it|mimics"),
    ):
        with pytest.raises(kd.MjcfError, match=said):
            kd.Leg.from_mjcf(written(tmp_path, body, more), "b")


def test_objects_beside_the_robot_are_left_out(tmp_path):
    assert kd.Leg.from_mjcf(MODELS / "pusher_v5.xml", "tips_arm").warnings[:1] == (
        "bodies attached to another root are left out: object, goal",
    )
    crowd = ARM.format(BALL) + "".join(
        f'<body name="b{k}"><freejoint/><geom size="1"/></body>' for k in range(7)
    )
    leg = arm(tmp_path, crowd)
    assert leg.warnings[0].endswith("left out: b0, b1, b2, b3, b4 and 2 more")
    assert leg.joint_names == ("j",)
    assert moment(leg) == pytest.approx(SPHERE)
    assert arm(tmp_path).warnings == (NO_DRIVES,)


@pytest.mark.parametrize(
    ("name", "frame", "joints"),
    [
        ("hopper.xml", "foot", "rootx, rootz, rooty"),
        ("walker2d_v5.xml", "foot", "rootx, rootz, rooty"),
        ("half_cheetah.xml", "bfoot", "rootx, rootz, rooty"),
        ("swimmer.xml", "back", "slider1, slider2, free_body_rot"),  # not singular: rotors
        ("inverted_pendulum.xml", "pole", "slider"),
    ],
)
def test_joints_of_the_file_that_move_the_root_are_its_base(name, frame, joints):
    said = (
        rf"base is 'floating', but joints of the file \({joints}\) move its root body already, "
        r"and are its base: read it with base='fixed'"
    )
    with pytest.raises(kd.MjcfError, match=said):
        kd.Leg.from_mjcf(MODELS / name, frame, base="floating")
    locked = dict.fromkeys(joints.split(", "), 0.0)
    leg = kd.Leg.from_mjcf(MODELS / name, frame, base="floating", locked=locked)
    assert leg.joint_names[0] == "root_joint"
    assert not set(locked) & set(leg.joint_names)
    with pytest.raises(kd.InvalidInput, match="joint 'rooty2' is unknown"):
        kd.Leg.from_mjcf(MODELS / name, frame, locked={"rooty2": 0.0})


def test_some_joints_of_the_root_may_be_locked():
    said = r"joints of the file \(rootx, rooty\) move"
    with pytest.raises(kd.MjcfError, match=said):
        kd.Leg.from_mjcf(MODELS / "hopper.xml", "foot", base="floating", locked={"rootz": 1.25})


def test_a_base_is_welded_where_the_file_places_it_or_floats(tmp_path):
    body = '<body name="base" pos="1 2 3">{}<geom size="0.2"/>' + ARM.format(BALL) + "</body>"
    for joint in ("", "<freejoint/>"):
        file = written(tmp_path, body.format(joint))
        fixed = kd.Leg.from_mjcf(file, "arm")
        assert fixed.joint_names == ("j",)
        assert fixed.posture([0]).contact_point == pytest.approx([1, 2, 3])
        floating = kd.Leg.from_mjcf(file, "arm", base="floating")
        assert floating.joint_names == ("root_joint", "j")
        posture = floating.posture(floating.configuration())
        assert posture.contact_point == pytest.approx([0, 0, 0])
        assert posture.inertia[0, 0] == pytest.approx(1000 * 4 / 3 * np.pi * 0.2**3 + 2)


def test_connected_bodies_are_a_loop(tmp_path):
    body = (
        '<body name="a"><joint name="ja" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body>'
        '<body name="b" pos="1 0 0"><joint name="jb" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/>'
        '<body name="c" pos="0 0 -1"><joint name="jc" axis="0 1 0"/>'
        '<geom size="0.1" pos="-0.5 0 0"/></body></body>'
    )
    whole = f'<body name="base"><geom size="0.1"/>{body}</body>'
    tie = '<equality><connect name="bar" {} anchor="0 0 -1"/></equality>'
    leg = kd.Leg.from_mjcf(written(tmp_path, whole, tie.format('body1="a" body2="c"')), "c")
    assert leg.constraints.loops == (("bar_1", "bar_2"),)
    straight = leg.configuration()
    np.testing.assert_allclose(leg.close_loops(straight), straight, atol=1e-12)
    posture = leg.posture(leg.close_loops(leg.configuration({"ja": 0.3}), keep=["ja"]))
    rates = posture.admissible([1.0, 0.0, 0.0])
    assert rates[0] == pytest.approx(rates[1])  # a parallelogram
    assert rates[2] == pytest.approx(-rates[1])
    for more, said in (
        (tie.format('body1="a"'), r"constraint 'bar' \(connect\) is not read"),
        ('<equality><joint joint1="ja"/></equality>', r"'equality0' \(joint\) .*lock its joints"),
        (
            '<equality><joint joint1="ja" joint2="jb" polycoef="0 1 1 0 0"/></equality>',
            r"\(joint\) is not read",
        ),
        ('<equality><weld body1="a" body2="c"/></equality>', r"\(weld\) is not read"),
    ):
        with pytest.raises(kd.MjcfError, match=said):
            kd.Leg.from_mjcf(written(tmp_path, whole, more), "c")
    couple = written(tmp_path, whole, '<equality><joint joint1="ja" joint2="jb"/></equality>')
    for locked in ({"ja": 0.1, "jb": 0.1}, {"j[ab]": 0.1}):
        assert kd.Leg.from_mjcf(couple, "c", locked=locked).joint_names == ("jc",)
    idle = tie.format('body1="a" body2="c" active="false"')
    assert kd.Leg.from_mjcf(written(tmp_path, whole, idle), "c").constraints is None


@pytest.mark.parametrize("by", ["sites", "bodies"])
def test_ends_of_a_connection_are_where_mujoco_has_them(tmp_path, by):
    """Turned sites away from their bodies' origins, or an anchor in the first body."""
    body = (
        '<body name="a" euler="10 20 30"><joint name="ja" axis="0 1 0"/><geom size="0.1"/>'
        '<site name="sa" pos="0.1 0.2 -0.3" euler="40 0 0"/></body>'
        '<body name="b" pos="1 0 0" euler="0 50 0"><joint name="jb" axis="0 1 0"/>'
        '<geom size="0.1"/><site name="sb" pos="-0.2 0.1 0.4" euler="0 0 70"/></body>'
    )
    ends = {"sites": 'site1="sa" site2="sb"', "bodies": 'body1="a" body2="b" anchor="1 2 3"'}[by]
    tie = f'<equality><connect name="bar" {ends}/></equality>'
    file = written(tmp_path, f'<body name="base"><geom size="0.1"/>{body}</body>', tie)
    leg, mujoco = kd.Leg.from_mjcf(file, "b"), pytest.importorskip("mujoco")
    compiled = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    first = data.body("a").xpos + data.body("a").xmat.reshape(3, 3) @ (1, 2, 3)
    wanted = [data.site("sa").xpos, data.site("sb").xpos] if by == "sites" else [first, first]
    own = leg.model.createData()
    pin.framesForwardKinematics(leg.model, own, leg.configuration())
    for name, place in zip(("bar_1", "bar_2"), wanted, strict=True):
        found = own.oMf[leg.model.getFrameId(name)].translation
        assert found == pytest.approx(place, abs=1e-12)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('<option gravity="0 0 -1.6"/>', r"gravity of the model is \[0.0, 0.0, -1.6, 0"),
        (
            '<tendon><spatial armature="1"><site site="a"/><site site="b"/></spatial></tendon>',
            "a tendon has an armature, which is not read",
        ),
        ('<compiler inertiafromgeom="maybe"/>', "MuJoCo cannot read it: .*'maybe'"),
    ],
)
def test_what_is_not_read_is_refused(tmp_path, more, said):
    ends = '<site name="a" pos="1 0 1"/>' + ARM.format(BALL + '<site name="b" pos="0 0 -1"/>')
    with pytest.raises(kd.MjcfError, match=said):
        arm(tmp_path, ends, more)


@pytest.mark.parametrize(
    "more", ['<option gravity="0 0 0"/>', '<option><flag gravity="disable"/></option>']
)
def test_weight_can_be_turned_off(tmp_path, more):
    assert arm(tmp_path, more=more).model.gravity.linear.tolist() == [0, 0, 0]
    assert arm(tmp_path).model.gravity.linear.tolist() == [0, 0, -9.81]


def test_mujoco_leaves_no_log(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    kd.Leg.from_mjcf(MODELS / "half_cheetah.xml", "bfoot")  # of whose settings it warns
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    said = r'ant.xml: MJCF needs the package mujoco: install it with pip install "kickdyn\[mjcf\]"$'
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_mjcf(MODELS / "ant.xml", "torso")
