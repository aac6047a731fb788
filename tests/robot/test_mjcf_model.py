"""MJCF models move and weigh as in MuJoCo, and settings of the format mean what they say."""

from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from chains import floating_leg
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, differenced, integrated, optimized

import kickdyn as kd
from kickdyn.robot.mjcf_file import quiet_mujoco
from kickdyn.robot.mjcf_model import mujoco_state

MODELS = Path(find_spec("gymnasium").origin).parent / "envs" / "mujoco" / "assets"
GYMNASIUM = {  # frame, and joints of the file that move its root body
    "humanoid.xml": ("right_foot", ""),
    "ant.xml": ("aux_1", ""),
    "half_cheetah.xml": ("bfoot", "rootx rootz rooty"),
    "hopper.xml": ("foot", "rootx rootz rooty"),
    "walker2d_v5.xml": ("foot", "rootx rootz rooty"),
    "swimmer.xml": ("back", "slider1 slider2 free_body_rot"),
    "inverted_pendulum.xml": ("pole", "slider"),
    "pusher_v5.xml": ("tips_arm", "r_shoulder_pan_joint"),  # with objects on a table
}


def written(tmp_path, body, more=""):
    """The path of a model with these bodies, and sections before them."""
    file = tmp_path / "robot.xml"
    file.write_text(f'<mujoco model="robot">{more}<worldbody>{body}</worldbody></mujoco>')
    return file


def check_against_mujoco(file, leg, frame, draw):
    """Compare the place and the velocity of a body and the kinetic energy at a random state."""
    with quiet_mujoco():
        compiled = mujoco.MjModel.from_xml_path(str(file))
    q = pin.integrate(leg.model, pin.neutral(leg.model), draw.uniform(-1, 1, leg.nv))
    v, data = draw.normal(size=leg.nv), mujoco.MjData(compiled)
    posture = leg.posture(q)
    data.qpos[:], data.qvel[:] = mujoco_state(leg.model, q, v, compiled)
    mujoco.mj_forward(compiled, data)
    momenta, jacobian = np.zeros(compiled.nv), np.zeros((3, compiled.nv))
    mujoco.mj_mulM(compiled, data, momenta, data.qvel)
    mujoco.mj_jacBody(compiled, data, jacobian, None, compiled.body(frame).id)
    rounding = closed_form(10)
    energy = 0.5 * v @ posture.inertia @ v
    assert energy == pytest.approx(0.5 * data.qvel @ momenta, rel=rounding)
    agrees(posture.contact_point, data.body(frame).xpos, rounding)
    agrees(posture.point_velocity(v), jacobian @ data.qvel, rounding)


@pytest.mark.parametrize("name", GYMNASIUM)
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_models_of_gymnasium(name, base):
    frame, joints = GYMNASIUM[name]
    if base == "floating" and joints:
        with pytest.raises(kd.MjcfError, match=rf"\({joints.replace(' ', ', ')}\) .*base='fixed'"):
            kd.Leg.from_mjcf(MODELS / name, frame, base=base)
        locked = dict.fromkeys(joints.split(), 0.0)
        leg = kd.Leg.from_mjcf(MODELS / name, frame, base=base, locked=locked)
        assert leg.joint_names[0] == "root_joint"
        assert not set(locked) & set(leg.joint_names)
    else:
        leg = kd.Leg.from_mjcf(MODELS / name, frame, base=base)
        check_against_mujoco(MODELS / name, leg, frame, np.random.default_rng(0))
    assert any("object, goal" in line for line in leg.warnings) == (name == "pusher_v5.xml")


def random_xml(draw, kinds, floating):
    """A tree of bodies in one element, each with up to three joints, on a body before it."""

    def text(values):
        return " ".join(f"{value:.17g}" for value in np.atleast_1d(values))

    bodies, parents = [], []
    for number, joints in enumerate(kinds):
        a, b, c = draw.uniform(0.001, 0.05, 3)
        lines = [f'<body name="body{number}" pos="{text(draw.uniform(-0.4, 0.4, 3))}" '
                 f'quat="{text(draw.normal(size=4))}">']  # fmt: skip
        for k, kind in enumerate(["free"] if floating and not number else joints):
            more = f' pos="{text(draw.uniform(-0.2, 0.2, 3))}"'
            if kind in ("hinge", "slide"):
                more += f' axis="{text(draw.normal(size=3))}" ref="{text(draw.uniform(-0.5, 0.5))}"'
            if kind != "free":
                more += f' armature="{text(draw.choice([0.0, draw.uniform(0.01, 0.5)]))}"'
            more = "" if kind == "free" else more
            lines.append(f'<joint name="body{number}_{k}" type="{kind}"{more}/>')
        lines.append(
            f'<inertial pos="{text(draw.uniform(-0.2, 0.2, 3))}" quat="{text(draw.normal(size=4))}"'
            f' mass="{text(draw.uniform(0.2, 8))}" diaginertia="{text((a + b, b + c, c + a))}"/>'
        )
        bodies.append("".join(lines))
        parents.append(int(draw.integers(number)) if number else -1)

    def nested(number):
        children = [k for k, parent in enumerate(parents) if parent == number]
        return bodies[number] + "".join(map(nested, children)) + "</body>"

    return nested(0)


JOINTS = st.lists(st.sampled_from(["hinge", "slide"]), min_size=1, max_size=2)


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    kinds=st.lists(JOINTS | st.just(["ball"]), min_size=2, max_size=5),
    floating=st.booleans(),
)
def test_random_models_move_and_weigh_as_in_mujoco(tmp_path_factory, seed, kinds, floating):
    draw = np.random.default_rng(seed)
    text, angles = random_xml(draw, kinds, floating), '<compiler angle="radian"/>'
    file, frame = written(tmp_path_factory.mktemp("model"), text, angles), f"body{len(kinds) - 1}"
    leg = kd.Leg.from_mjcf(file, frame, base="floating" if floating else "fixed")
    check_against_mujoco(file, leg, frame, draw)


ARM = '<body name="arm"><joint name="j" axis="0 1 0"/>{}</body>'
BALL = '<geom type="sphere" size="0.1" pos="0 0 -1" mass="2"/>'


def arm(tmp_path, body=None, more=""):
    return kd.Leg.from_mjcf(written(tmp_path, body or ARM.format(BALL), more), "arm")


@pytest.mark.parametrize(("joint", "more", "span"), [
    ('range="-90 45"', "", (-np.pi / 2, np.pi / 4)),
    ('range="-1 2"', '<compiler angle="radian"/>', (-1, 2)),
    ('type="slide" range="-1 2"', "", (-1, 2)),  # metres, whatever the angles are in
    ('range="-1 2" limited="false"', "", (-np.inf, np.inf)), ("", "", (-np.inf, np.inf)),
])  # fmt: skip
def test_range_of_a_joint(tmp_path, joint, more, span):
    body = f'<body name="arm"><joint name="j" axis="0 1 0" {joint}/>{BALL}</body>'
    assert arm(tmp_path, body, more).joint_range("j") == pytest.approx(span)


@pytest.mark.parametrize(("joint", "actuators", "limit"), [
    ("", "", np.inf), ('actuatorfrcrange="-20 20"', "", 20),
    ("", '<motor joint="j" gear="50" ctrlrange="-2 3"/>', 100),
    ("", '<motor joint="j" gear="-50" ctrlrange="-2 2" forcerange="-1 1"/>', 50),
    ("", '<position joint="j" kp="100" forcerange="-7 7" ctrlrange="-1 1"/>', 7),
    ("", '<position joint="j" kp="100" ctrlrange="-1 1"/>', np.inf),
    ("", '<motor joint="j" forcerange="-4 9"/>', 4),
    ("", '<general joint="j" gainprm="3" ctrlrange="-2 2"/>', 6),
    ('actuatorfrcrange="-8 8"', 2 * '<motor joint="j" ctrlrange="-3 3"/>', 6),
    ('actuatorfrcrange="-5 5"', 2 * '<motor joint="j" ctrlrange="-3 3"/>', 5)])  # fmt: skip
def test_limit_of_torque(tmp_path, joint, actuators, limit):
    body = f'<body name="arm"><joint name="j" axis="0 1 0" {joint}/>{BALL}</body>'
    leg = arm(tmp_path, body, f"<actuator>{actuators}</actuator>")
    assert leg.effort_limit.tolist() == [limit]
    assert leg.velocity_limit.tolist() == [np.inf]


def test_a_base_is_welded_where_the_file_places_it_or_floats(tmp_path):
    body = '<body name="base" pos="1 2 3">{}<geom size="0.2"/>' + ARM.format(BALL) + "</body>"
    for joint in ("", "<freejoint/>"):
        file = written(tmp_path, body.format(joint))
        assert kd.Leg.from_mjcf(file, "arm").posture([0]).contact_point == pytest.approx([1, 2, 3])
        floating = kd.Leg.from_mjcf(file, "arm", base="floating")
        assert floating.joint_names == ("root_joint", "j")
        posture = floating.posture(floating.configuration())
        assert posture.contact_point == pytest.approx([0, 0, 0])
        assert posture.inertia[0, 0] == pytest.approx(1000 * 4 / 3 * np.pi * 0.2**3 + 2)


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1), facing=st.sampled_from(["x", "y", "-x", "-y"]))
def test_a_leg_is_turned_alike_on_both_bases(tmp_path_factory, seed, facing):
    """A floating base starts as the file turns it, and its place at the origin."""
    text = random_xml(np.random.default_rng(seed), [[], ["hinge"], ["slide"]], seed % 2)
    file = written(tmp_path_factory.mktemp("model"), text)
    fixed, floating = (
        leg.posture(leg.configuration({"body1_0": 0.3}))
        for base in ("fixed", "floating")
        if (leg := kd.Leg.from_mjcf(file, "body2", base=base, facing=facing))
    )
    agrees(floating.rotation_world_joint, fixed.rotation_world_joint, closed_form(10))
    agrees(floating.jacobian[:, 6:], fixed.jacobian, closed_form(10))


SLIDING_KNEE = (
    '<body name="a"><joint name="hip" axis="0 1 0"/><geom size="0.1" pos="0.02 0 -0.5"/>'
    '<body name="b" pos="0 0 -0.5"><joint name="slide" type="slide" axis="1 0 0"/>'
    '<joint name="knee" axis="0 1 0"/><geom size="0.1" pos="0.1 0 -0.3"/>'
    '<body name="foot" pos="0 0 -0.5"><joint name="ankle" axis="0 1 0"/>'
    '<geom size="0.08" pos="0.1 0 -0.1"/></body></body></body>'
)
KICKER = (
    f'<body name="trunk"><freejoint/><geom size="0.15"/>{SLIDING_KNEE}<body name="thigh" pos='
    '"0 -0.2 0"><joint name="other" axis="0 1 0"/><geom size="0.08" pos="0 0 -0.3"/><body '
    'name="toe" pos="0 0 -0.5"><joint name="shin" axis="0 1 0"/><geom size="0.05" pos="0.1 0 0"/>'
    "</body></body></body>"
)


@pytest.mark.parametrize(("body", "frame"), [(SLIDING_KNEE, "foot"), (KICKER, "toe")])
def test_the_impact_of_a_knee_that_slides_as_it_bends(tmp_path, body, frame):
    """By a polynomial, as in models of muscles: energy of a contact, derivatives by q.

    Of a leg that kicks, and of one on which the robot stands.
    """
    tie = '<joint joint1="slide" joint2="knee" polycoef="0.01 0.02 -0.05 0.03 0.01"/>'
    file = written(tmp_path, body, f"<equality>{tie}</equality>")
    leg = kd.Leg.from_mjcf(file, frame, base="fixed" if frame == "foot" else "floating")
    leg = leg if frame == "foot" else leg.with_supports("foot")
    q = leg.configuration({"hip": 0.5, "knee": 0.7, "ankle": -0.2})
    v, step = np.random.default_rng(0).uniform(-3, 3, (2, leg.nv))
    v, along, slide = leg.posture(q).admissible(v), step.copy(), leg.velocity_index("slide")
    along[slide] -= leg.gears.rows(q)[0] @ step  # as the knee moves it

    def moved(t):
        return leg.posture(leg.gears.follow(pin.integrate(leg.model, q, t * along)))

    normal = leg.posture(q).point_velocity(v)

    def kick(t):
        return moved(t), moved(t).admissible(v), kd.Ball(), kd.Contact(normal, 0.7, 0.3)

    assert kd.collide(*kick(0.0)).energy_residual < integrated(1e-9)
    slopes = kd.strike(*kick(0.0)).sensitivity()
    for name in ("impulse", "v_after", "joint_impulses"):
        near, far = (
            getattr(kd.strike(*kick(h)), name) - getattr(kd.strike(*kick(-h)), name)
            for h in (1e-3, 2e-3)
        )
        agrees(getattr(slopes, name)["q"] @ along, (8 * near - far) / 12e-3, 10 * differenced())


def test_connected_bodies_are_a_loop(looped_mjcf):
    leg = kd.Leg.from_mjcf(looped_mjcf, "c")
    assert leg.constraints.loops == (("bar_1", "bar_2"),)
    agrees(leg.close_loops(leg.configuration()), leg.configuration(), optimized(1e-10))
    posture = leg.posture(leg.close_loops(leg.configuration({"ja": 0.3}), keep=["ja"]))
    rates = posture.admissible([1.0, 0.0, 0.0])
    assert rates[1:] == pytest.approx([rates[0], -rates[0]])  # a parallelogram


@pytest.mark.parametrize(("equality", "said"), [
    ('<connect name="bar" body1="a" anchor="0 0 -1"/>', r"'bar' \(connect\)"),
    ('<joint joint1="ja"/>', r"\(joint\) .*lock"),
    ('<joint joint1="ja" joint2="jb"/><joint joint1="jb" joint2="ja"/>', "ja, jb mimic each other"),
    ('<joint joint1="jb" joint2="ja"/><joint joint1="jb" joint2="jc"/>',
     "'jb' mimics 'ja' and 'jc': a joint can mimic one; lock them, locked={'jb': 0, 'ja': 0, 'jc'"),
    ('<weld body1="a" body2="c"/>', r"\(weld\)"),
    ('<connect body1="a" body2="c" anchor="0 0 -1" active="false"/>', None)])  # fmt: skip
def test_other_constraints_are_refused_unless_they_are_idle(looped_mjcf, equality, said):
    start, _, end = looped_mjcf.read_text().partition("<equality>")
    looped_mjcf.write_text(f"{start}<equality>{equality}{end[end.index('</equality>') :]}")
    if said is None:
        assert kd.Leg.from_mjcf(looped_mjcf, "c").constraints is None
        return
    with pytest.raises(kd.MjcfError, match=said):
        kd.Leg.from_mjcf(looped_mjcf, "c")
    if "(joint)" in said.replace("\\", ""):
        leg = kd.Leg.from_mjcf(looped_mjcf, "c", locked={"j[ab]": 0.1})
        assert leg.joint_names == ("jc",)


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
    leg, compiled = kd.Leg.from_mjcf(file, "b"), mujoco.MjModel.from_xml_path(str(file))
    data, places = mujoco.MjData(compiled), leg.model.createData()
    mujoco.mj_forward(compiled, data)
    anchor = data.body("a").xpos + data.body("a").xmat.reshape(3, 3) @ (1, 2, 3)
    right = [data.site("sa").xpos, data.site("sb").xpos] if by == "sites" else [anchor, anchor]
    pin.framesForwardKinematics(leg.model, places, leg.configuration())
    for name, place in zip(("bar_1", "bar_2"), right, strict=True):
        frame = places.oMf[leg.model.getFrameId(name)]
        assert frame.translation == pytest.approx(place, abs=closed_form(10)), name


@pytest.mark.parametrize(("more", "said"), [
    ('<option gravity="0 0 -1.6"/>', r"gravity .*-1.6"),
    ('<tendon><spatial armature="1"><site site="a"/><site site="b"/></spatial></tendon>',
     "tendon has an armature"),
    ('<compiler inertiafromgeom="maybe"/>', "'maybe'")])  # fmt: skip
def test_settings_that_change_the_mechanics_are_refused(tmp_path, more, said):
    ends = '<site name="a" pos="1 0 1"/>' + ARM.format(BALL + '<site name="b" pos="0 0 -1"/>')
    with pytest.raises(kd.MjcfError, match=said):
        arm(tmp_path, ends, more)


def test_a_foot_without_mass_may_be_locked(tmp_path):
    """The shank then has what it has without the foot; a free foot is refused with a remedy."""
    foot = '<body name="foot" pos="0 0 -1"><joint name="ankle" axis="0 1 0"/></body>'
    right = arm(tmp_path).posture([0.3]).inertia
    file = written(tmp_path, ARM.format(BALL + foot))
    leg = kd.Leg.from_mjcf(file, "foot", locked={"ankle": 0})
    assert leg.posture([0.3]).inertia == pytest.approx(right)
    with pytest.raises(kd.MjcfError, match=r"'ankle' moves .*mass 0 kg.*--lock ankle=0"):
        kd.Leg.from_mjcf(file, "foot")


def test_weight_can_be_turned_off(tmp_path):
    for more, weight in (("", -9.81), ('<option><flag gravity="disable"/></option>', 0)):
        assert arm(tmp_path, more=more).model.gravity.linear.tolist() == [0, 0, weight]


def test_continuous_joints_have_one_angle_in_mujoco():
    leg = floating_leg(np.random.default_rng(0))
    q = leg.configuration({"hip": 0.3, "knee": 0.4})
    qpos, _ = mujoco_state(leg.model, q, np.zeros(leg.nv))
    assert qpos[-2:] == pytest.approx([0.3, 0.4])


TURNS = {"x": 0.0, "y": -np.pi / 2, "-x": np.pi, "-y": np.pi / 2}
"""By the axis along which a robot faces, the angle about z by which it is turned to face x."""


@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), facing=st.sampled_from(list(TURNS)))
def test_effective_masses_are_those_of_mujoco_where_joints_follow_polynomials(
    tmp_path_factory, seed, facing
):
    r"""With v = P x of the free joints x, the foot has :math:`(J P) (P^T M P)^{-1} (J P)^T`.

    A joint that follows another, and is locked, locks those that follow it.
    """
    draw = np.random.default_rng(seed)
    kinds = [["hinge", "slide"][: draw.integers(1, 3)] for _ in range(4)]
    names = [f"body{n}_{k}" for n, joints in enumerate(kinds) for k in range(len(joints))]
    followers = {names[-1]: names[0], names[-3]: draw.choice([names[-1], names[0]])}
    series = {name: draw.uniform(-0.5, 0.5, 5) for name in followers}
    ties = "".join(
        f'<joint joint1="{name}" joint2="{driver}" '
        f'polycoef="{" ".join(map(repr, series[name].tolist()))}"/>'
        for name, driver in followers.items()
    )
    more = f'<compiler angle="radian"/><equality>{ties}</equality>'
    file = written(tmp_path_factory.mktemp("leg"), random_xml(draw, kinds, floating=False), more)
    locked = {names[-1]: draw.uniform(-1, 1)} if seed % 2 else {}
    leg = kd.Leg.from_mjcf(file, "body3", facing=facing, locked=locked)
    compiled = mujoco.MjModel.from_xml_path(str(file))
    free = [name for name in names if name not in followers]
    values = dict(zip(free, draw.uniform(-1, 1, len(free)), strict=True))
    slopes, start = dict(zip(free, np.eye(len(free)), strict=True)), compiled.qpos0
    for name, driver in followers.items():
        since_ref = values[driver] - start[compiled.joint(driver).qposadr[0]]
        follows = np.polynomial.Polynomial(series[name])
        values[name] = follows(since_ref) + start[compiled.joint(name).qposadr[0]]
        slopes[name] = follows.deriv()(since_ref) * slopes[driver]
        if name in locked:
            values[name], slopes[name] = locked[name], 0.0 * slopes[name]
    names = [compiled.joint(number).name for number in range(compiled.njnt)]  # in its order
    data, inertia = mujoco.MjData(compiled), np.eye(compiled.nv)
    data.qpos[:] = [values[name] for name in names]
    mujoco.mj_forward(compiled, data)
    assert locked or np.abs(data.efc_pos[: data.ne]).max() < closed_form(100)
    for unit in np.eye(compiled.nv):
        mujoco.mj_mulM(compiled, data, inertia[np.argmax(unit)], unit)
    jacobian = np.zeros((3, compiled.nv))
    mujoco.mj_jacBody(compiled, data, jacobian, None, compiled.body("body3").id)
    present = [name for name in names if name in leg.joint_names]
    assert present == [name for name in names if not locked or slopes[name].any()]
    posture = leg.posture(leg.configuration({name: values[name] for name in present}))
    order, rows = map(leg.velocity_index, present), [names.index(name) for name in present]
    columns = np.ix_(*2 * [[*order]])
    agrees(posture.inertia[columns], inertia[np.ix_(rows, rows)], closed_form(100))
    reduced, normal = np.array([slopes[name] for name in names]), draw.normal(size=3)
    normal /= np.linalg.norm(normal)
    row = pin.utils.rotate("z", TURNS[facing]).T @ normal @ jacobian @ reduced
    mobility = row @ np.linalg.solve(reduced.T @ inertia @ reduced, row)
    assert posture.effective_mass(normal) == pytest.approx(1.0 / mobility, rel=1e-10)
