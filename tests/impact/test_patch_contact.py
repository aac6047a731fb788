"""The contact of an inflated ball with a strip of a foot."""

import math
import pickle

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import dblquad, solve_ivp

import kickdyn as kd
from kickdyn.impact.inflated_force import OUTSIDE_PRESSURE
from kickdyn.impact.patch_contact import overlap

BALL = kd.Ball(pressure=80e3)
R = BALL.radius


def free_body(mass=1.95):
    """A body without support or gravity, whose contact frame is beside its centre of mass."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    body = pin.Inertia(mass, np.array([-0.05, 0.01, 0.02]), np.diag([0.01, 0.02, 0.015]))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.gravity = pin.Motion.Zero()
    return kd.Leg.from_model(model, "toe").posture([0, 0, 0, 0, 0, 0, 1])


def slider(mass=1.95):
    """A body that does not turn."""
    model, parent = pin.Model(), 0
    for kind in (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ()):
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), f"rail{parent}")
        body = pin.Inertia(mass if parent == 3 else 1e-9, np.zeros(3), 1e-3 * np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.gravity = pin.Motion.Zero()
    return kd.Leg.from_model(model, "toe").posture(np.zeros(3))


FOOT, FREE = slider(), free_body()


def kick(patch, friction=0.0, e="inflated", v=(14.0, 0.0, 0.0), foot=FOOT, **options):
    contact = kd.Contact((1, 0, 0), e, friction)
    return kd.collide(foot, v, BALL, contact, model=patch, **{"tol": 1e-11, **options})


@pytest.mark.parametrize(
    ("deflection", "centre", "half"),
    [(0.02, 0.01, math.inf), (0.02, 0.01, 0.03), (0.04, 0.05, 0.03), (0.05, -0.02, 0.04)],
)
def test_the_overlap_is_an_integral_and_its_slopes(deflection, centre, half):
    a, height = math.sqrt(deflection * (2 * R - deflection)), R - deflection
    low, high = max(-a, -half - centre), min(a, half - centre)

    def over(f, power=0.5):
        def edge(x):
            return math.sqrt(max(a * a - x * x, 0.0))

        return dblquad(f, low, high, lambda x: -edge(x), edge, epsabs=1e-13, epsrel=1e-11)[0]

    shape = overlap(deflection, centre, R, half)
    depth = over(lambda y, x: math.sqrt(R * R - x * x - y * y) - height)
    assert shape.volume == pytest.approx(depth, rel=1e-7)
    assert shape.area == pytest.approx(over(lambda y, x: 1.0), rel=1e-7)
    step = 1e-6

    def slope(name, along, across):
        ends = [
            np.array(getattr(overlap(deflection + h * along, centre + h * across, R, half), name))
            for h in (step, -step)
        ]
        return (ends[0] - ends[1]) / (2 * step)

    assert slope("volume", 1, 0) == pytest.approx(shape.area, rel=1e-6)
    assert slope("volume", 0, 1) == pytest.approx(shape.across, rel=1e-6, abs=1e-12)
    assert slope("area", 1, 0) == pytest.approx(shape.area_slopes[0], rel=1e-6)
    assert slope("area", 0, 1) == pytest.approx(shape.area_slopes[1], rel=1e-6, abs=1e-10)


@pytest.mark.parametrize("patch", [kd.FootPatch(math.inf), kd.FootPatch(0.3, 0.01)])
def test_a_wide_strip_is_the_point(patch):
    """The force of the plane, up to the second order of the deflection, and no spin."""
    for speed in (2.0, 14.0):
        wide = kick(patch, v=(speed, 0, 0))
        point = kd.collide(FOOT, (speed, 0, 0), BALL, wide.contact, tol=1e-10)
        second = 0.25 * (point.deflection / R) ** 2
        assert wide.ball_after.velocity == pytest.approx(
            point.ball_after.velocity, abs=second * speed
        )
        assert wide.ball_after.spin == pytest.approx(np.zeros(3), abs=1e-9)
        assert wide.ball_after.velocity[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("e", [1.0, 0.7])
def test_a_wide_strip_has_the_restitution_that_is_given(e):
    hit = kick(kd.FootPatch(math.inf), e=e)
    assert hit.ball_after.velocity[0] - hit.v_after[0] == pytest.approx(14.0 * e, rel=1e-9)


def test_small_deflections_give_the_spring_from_pressure():
    slow = kick(kd.FootPatch(0.2), e=1.0, v=(0.1, 0, 0))
    spring = kd.collide(FOOT, (0.1, 0, 0), BALL, slow.contact, stiffness="pressure")
    small = spring.deflection / R
    assert slow.peak_force == pytest.approx(spring.peak_force, rel=small)
    assert slow.contact_time == pytest.approx(spring.contact_time, rel=small)


def test_the_middle_of_a_strip_gives_no_spin_and_its_edge_a_little():
    spins = [kick(kd.FootPatch(0.08, x)).ball_after.spin[2] for x in (0.0, 0.02, 0.04)]
    assert abs(spins[0]) < 1e-9
    assert 1.0 < spins[1] < spins[2] < 15.0
    assert kick(kd.FootPatch(0.08, -0.02)).ball_after.spin[2] == pytest.approx(-spins[1], rel=1e-7)


def test_without_loss_and_friction_a_patch_gives_no_spin():
    """The pressure acts through the centre: a turned sphere has the same overlap."""
    hit = kick(kd.FootPatch(0.08, 0.03), e=1.0)
    assert np.abs(hit.ball_after.spin).max() < 1e-12
    assert hit.energy_lost == pytest.approx(0.0, abs=1e-12)
    assert hit.ball_after.velocity[1] > 1.0  # the edge pushes it aside


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("offset", [0.0, 0.025])
@pytest.mark.parametrize("e", ["inflated", 0.7])
def test_energy_and_momentum_are_balanced(friction, offset, e):
    v = np.array([14.0, 3.0, 1.0, 1.0, -4.0, 3.0])
    spin = (5.0, -10.0, 20.0)
    hit = kick(kd.FootPatch(0.08, offset), friction, e, v, FREE, ball_spin=spin, tol=1e-12)

    def momentum(q, v, ball):
        model = FREE.leg.model
        data = model.createData()
        foot = pin.computeCentroidalMomentum(model, data, q, v)
        about = foot.angular + np.cross(data.com[0], foot.linear)
        linear = BALL.mass * ball.velocity
        turning = BALL.inertia * ball.spin + np.cross(ball.position, linear)
        return np.concatenate([foot.linear + linear, about + turning])

    before = momentum(FREE.q, v, hit.ball_before)
    after = momentum(hit.q_after, hit.v_after, hit.ball_after)
    assert after == pytest.approx(before, abs=1e-10 * np.abs(before).max())
    assert hit.energy_residual < 1e-10
    assert hit.energy_lost > 0.0


def test_two_bodies_by_another_method():
    """Radau in the plane, without friction: pressure, edges, rim, and what the shell loses."""
    half, offset, mass, speed = 0.04, 0.03, 1.95, 14.0
    m, inertia, flux = BALL.mass, BALL.inertia, BALL.mass / (4 * math.pi * R)

    def rates(_, y, share):
        d, c, foot_x, foot_y, vx, vy, spin = y
        shape = overlap(d, c, R, half)
        left = 1 - shape.volume / (4 / 3 * math.pi * R**3)
        p = share * ((80e3 + OUTSIDE_PRESSURE) * left**-1.4 - OUTSIDE_PRESSURE)
        closing, (angle, x, xx, _) = foot_x - vx, shape.rim
        rim = flux * max(closing, 0.0) * (closing * angle + spin * x > 0.0)
        stopped, moment = rim * (closing * angle + spin * x), -rim * (closing * x + spin * xx)
        force, edge = p * shape.area + stopped, -p * shape.across
        return [closing, vy - foot_y, -force / mass, -edge / mass, force / m, edge / m,
                moment / inertia]  # fmt: skip

    def full(_, y, share):
        shape = overlap(y[0], y[1], R, half)
        return shape.area * (y[2] - y[4]) + shape.across * (y[5] - y[3]) + (y[0] <= 0)

    def apart(_, y, share):
        return overlap(y[0], y[1], R, half).volume - 1e-15

    full.terminal = apart.terminal = True
    full.direction = apart.direction = -1
    tol = {"method": "Radau", "rtol": 1e-10, "atol": 1e-13, "max_step": 4e-5}
    start = (1e-13, offset, speed, 0, 0, 0, 0)
    one = solve_ivp(rates, (0, 0.1), start, events=full, args=(1.0,), **tol)
    two = solve_ivp(rates, (0, 0.1), one.y[:, -1], events=apart, args=(0.899**2,), **tol)
    *_, foot_x, foot_y, vx, vy, spin = two.y[:, -1]
    hit, off = kick(kd.FootPatch(2 * half, offset), tol=1e-12), 1e-8 * math.hypot(vx, vy)
    assert hit.ball_after.velocity[:2] == pytest.approx([vx, vy], abs=off)
    assert hit.ball_after.spin[2] == pytest.approx(spin, abs=off / R)
    assert hit.v_after[:2] == pytest.approx([foot_x, foot_y], abs=off)


def bounce(grip, friction=0.8):
    """A ball at 10 m/s that meets a level, wide and heavy foot, 45 deg from above."""
    foot = slider(1e4)
    contact = kd.Contact((0, 0, 1), "inflated", friction)
    ball_velocity = 10.0 * np.array([1, 0, -1]) / math.sqrt(2)
    patch = kd.FootPatch(math.inf, across=(1, 0, 0), grip=grip)
    return kd.collide(foot, np.zeros(3), BALL, contact, model=patch, ball_velocity=ball_velocity,
                      tol=1e-9)  # fmt: skip


def test_a_patch_that_grips_turns_the_ball_faster_than_rolling():
    """A rigid contact that sticks ends in rolling; the shear of the patch gives some of it back."""
    after = bounce(2 / 3).ball_after
    slip = after.velocity[0] - R * after.spin[1]
    assert slip < -0.1
    rolling = kd.strike(
        slider(1e4), np.zeros(3), BALL, kd.Contact((0, 0, 1), "inflated", 0.8), law="stronge",
        ball_velocity=10.0 * np.array([1, 0, -1]) / math.sqrt(2),
    ).ball_after  # fmt: skip
    assert rolling.velocity[0] == pytest.approx(R * rolling.spin[1], rel=1e-3)
    assert after.spin[1] > rolling.spin[1]


def test_a_patch_that_slides_has_coulombs_friction():
    hit = bounce(30.0, 0.05)
    along, _, up = hit.impulse
    assert along == pytest.approx(-0.05 * up, rel=0.02)


def test_the_surface_of_a_foot():
    leg = kd.kick_with(kd.Leg.from_robot("g1"), "instep")
    posture = leg.posture(leg.configuration())
    v = posture.joint_velocity([8.0, 0, 0])
    size = kd.foot_surfaces(leg)["instep"].size
    contact = kd.Contact((1, 0, 0), "inflated", 0.4, offset=(0, 0.01, 0))
    hit = kd.collide(posture, v, BALL, contact, model="patch", tol=1e-7)
    given = kd.FootPatch(float(size[0]), 0.01)
    named = kd.collide(posture, v, BALL, contact, model=given, tol=1e-7)
    assert hit.impulse == pytest.approx(named.impulse, rel=1e-6, abs=1e-6)
    again = pickle.loads(pickle.dumps(hit))
    assert (again.impulse == hit.impulse).all()


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: kd.FootPatch(0.0), r"patch width is 0(\.0)?: .*above 0"),
        (lambda: kd.FootPatch(0.1, math.nan), "patch offset is nan"),
        (lambda: kd.FootPatch(0.1, grip=0), "patch grip is 0"),
        (lambda: kick(kd.FootPatch(0.1, across=(1, 0, 0))), "patch direction .*not be the normal"),
        (lambda: kick("disc"), "model is 'disc': it must be 'point', 'patch' or a FootPatch"),
        (lambda: kick("patch"), "at toe of .* has no shapes that span a volume"),
        (lambda: kick(kd.FootPatch(0.1), stiffness=1e5), "a patch follows from the ball's"),
        (lambda: kick(kd.FootPatch(0.04, 0.08)), "14 m/s .* press the ball beyond its radius"),
        (lambda: kick(kd.FootPatch(0.08, 30.0)), "patch offset is 30 m: .* less than 0.149"),
        (lambda: kick(kd.FootPatch(0.08, 0.149)), "with an offset of 0.149 m, the strip would"),
        (lambda: kick(kd.FootPatch(0.01), v=(17, 0, 0)), "patch width is 0.01 m: at an approach"),
        (
            lambda: kd.collide(FOOT, (9, 0, 0), kd.Ball(), kd.Contact((1, 0, 0)),
                               model=kd.FootPatch(0.1)),
            "ball pressure is None",
        ),
        (lambda: kick(kd.FootPatch(0.1), tol=1e-6).joint_impulses, "joint impulses .*use 'point'"),
    ],
)  # fmt: skip
def test_bad_input(call, line):
    with pytest.raises(kd.InvalidInput, match=line) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_a_ball_flattened_beyond_the_model_is_named():
    (line,) = kick(kd.FootPatch(0.05, 0.01), v=(22.0, 0, 0), tol=1e-6).warnings
    assert "at an approach speed of 22 m/s: the model 'inflated' goes up to 0.6" in line
