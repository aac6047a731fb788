"""A plane, and the flights, slides and rolls that end at it."""

import dataclasses
import math

import numpy as np
import pytest
from mpmath import mp, mpf

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.ground import Surface

BALL = kd.Ball()
R = BALL.radius
AIRS = {"vacuum": None, "air": kd.Air()}
every_air = pytest.mark.parametrize("air", AIRS.values(), ids=AIRS)
WALL = kd.Plane((10, 0, 0), (-1, 0, 0))


def launch(velocity, at=(0, 0, 0), spin=(0, 0, 0)):
    return kd.BallState(at, velocity, spin)


# --- the noun -----------------------------------------------------------------------------------


def test_plane_is_checked_and_frozen():
    plane = kd.Plane((1, 2, 3), (0, 0, -5))
    assert plane.normal.tolist() == [0, 0, -1]
    with pytest.raises(ValueError, match="read-only"):
        plane.normal[0] = 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        plane.point = 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (((0, 0), (1, 0, 0)), "point of the plane has shape"),
        (((0, 0, math.nan), (1, 0, 0)), "point of the plane .* finite"),
        (((0, 0, 0), (0, 0, 0)), "normal of the plane .* no direction"),
        (((0, 0, 0), (1, 0, 0), "middle"), "reached_by is 'middle': .* front, centre, back"),
    ],
)
def test_bad_planes(arguments, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Plane(*arguments)


def test_planes_of_the_same_values_are_equal():
    one, other = kd.Plane((1, 2, 3), (0, 0, -5)), kd.Plane([1.0, 2, 3], (0, 0, -1), "front")
    assert one == other
    assert hash(one) == hash(other)
    assert one != kd.Plane((1, 2, 3), (0, 0, -5), "back")
    assert one != kd.Plane((1, 2, 4), (0, 0, -5))
    assert one != (1, 2, 3)


def test_what_is_no_plane_is_refused():
    with pytest.raises(kd.InvalidInput, match=r"plane is 10\.0: it must be a kickdyn\.Plane"):
        kd.fly(launch((9, 0, 9)), BALL, plane=10.0)


@every_air
def test_a_start_beyond_is_refused(air):
    with pytest.raises(kd.InvalidInput, match=r"front starts 1\.1\d* m beyond the plane: the norm"):
        kd.fly(launch((9, 0, 9), at=(11, 0, 0)), BALL, air, plane=WALL)
    over = kd.Plane((10, 0, 0), (-1, 0, 0), "back")  # not wholly over: goes on
    assert kd.fly(launch((9, 0, 9), at=(10.05, 0, 0)), BALL, air, plane=over).duration > 0


# --- closed forms -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("normal", "gap"),
    [
        ((-1, 0, 0), 5.0),
        ((-1, 0.3, 0.2), 3.0),
        ((-0.5, 0, -2), 2.0),
        ((0, 0, -1), 4.0),
        ((-1, 0, 1), 0.5),
        ((0, -1, 0), 1e-9),
    ],
)
def test_vacuum(normal, gap):
    n = np.array(normal) / np.linalg.norm(normal)
    velocity = np.array([12.0, 2.0, 10.0])
    plane = kd.Plane(-gap * n, normal, "centre")
    path = kd.fly(launch(velocity), BALL, plane=plane)
    with mp.workdps(40):
        a, b = -mpf(9.81) * mpf(n[2]) / 2, mpf(float(n @ velocity))
        spread = mp.sqrt(b**2 - 4 * a * mpf(gap))
        roots = [(-b + sign * spread) / (2 * a) for sign in (1, -1)] if a else [-gap / b]
        t = min(float(root) for root in roots if mp.im(root) == 0 and mp.re(root) > 0)
    assert (path.status, path.method) == ("at-plane", "closed form")
    assert path.duration == pytest.approx(t, rel=1e-13)
    expected = velocity * t - [0, 0, 9.81 / 2 * t * t]
    assert path.landing.position == pytest.approx(expected, rel=1e-12, abs=1e-14)


def test_creeping_flow_against_a_wall():
    bead = kd.Ball(mass=1e-3, radius=1e-3)
    syrup = kd.Air(density=1.2, viscosity=0.5, drag="stokes", lift=None, buoyancy=False)
    tau = 1e-3 / (6 * math.pi * 0.5 * 1e-3)
    wall = kd.Plane((0.012, 0, 0), (-1, 0, 0))
    path = kd.fly(launch((0.3, 0.1, 0.5)), bead, syrup, tol=1e-12, plane=wall)
    t = -tau * math.log1p(-0.011 / (0.3 * tau))  # the surface touches
    assert path.status == "at-plane"
    assert path.duration == pytest.approx(t, rel=1e-10)
    assert path.landing.position[:2] == pytest.approx([0.011, 0.011 / 3], rel=1e-10)


def test_quadratic_drag_into_the_ceiling():
    air = kd.Air(drag=constant(0.4), lift=None, buoyancy=False)
    k = 0.5 * air.density * BALL.cross_section * 0.4 / BALL.mass
    ceiling = kd.Plane((0, 0, 6 + R), (0, 0, -1))
    path = kd.fly(launch((0, 0, 15)), BALL, air, tol=1e-12, plane=ceiling)
    speed = math.sqrt((15**2 + 9.81 / k) * math.exp(-2 * k * 6) - 9.81 / k)
    s = math.sqrt(k / 9.81)
    t = (math.atan(15 * s) - math.atan(speed * s)) / math.sqrt(9.81 * k)
    assert path.status == "at-plane"
    assert path.duration == pytest.approx(t, rel=1e-11)
    assert path.landing.velocity[2] == pytest.approx(speed, rel=1e-11)
    assert path.apex.position[2] == path.landing.position[2] == pytest.approx(6, rel=1e-12)


@pytest.mark.parametrize("air", [None, kd.Air(density=1e-12)], ids=["vacuum", "air"])
def test_a_plane_below_that_falls_away_faster_is_never_reached(air):
    hull = kd.Plane((0, 0, 1), (0, 0.1, -1), "centre")  # a ceiling that slopes
    path = kd.fly(launch((3, 0, 3)), BALL, air, plane=hull)  # rises 0.46 m
    assert path.status == "landed"


# --- where and when -----------------------------------------------------------------------------


@every_air
def test_which_part_of_the_ball_counts(air):
    for part, x in (("front", 10 - R), ("centre", 10), ("back", 10 + R)):
        plane = kd.Plane((10, 0, 0), (-1, 0, 0), part)
        path = kd.fly(launch((25, 1, 8), spin=(0, -20, 9)), BALL, air, plane=plane)
        assert path.status == "at-plane"
        assert path.landing.position[0] == pytest.approx(x, abs=1e-13)


@every_air
def test_at_the_plane_it_is_where_it_arrives(air):
    state = launch((25, 1, 8), spin=(0, -20, 9))
    free = kd.fly(state, BALL, air, tol=1e-12)
    stopped = kd.fly(state, BALL, air, tol=1e-12, plane=kd.Plane((30, 0, 0), (-1, 0, 0), "centre"))
    assert stopped.landing.position == pytest.approx(free.arrival(30.0).position, abs=1e-13)
    here = free.sample(stopped.duration)
    assert stopped.landing.position == pytest.approx(here.position, abs=1e-8)
    assert stopped.landing.velocity == pytest.approx(here.velocity, abs=1e-8)
    assert stopped.apex.position == pytest.approx(free.apex.position, abs=1e-9)
    last = stopped.sample(stopped.duration)
    assert last.position == pytest.approx(stopped.landing.position, abs=1e-12)


@every_air
def test_whichever_comes_first(air):
    near, far = (kd.Plane((x, 0, 0), (-1, 0, 0)) for x in (5, 500))
    assert kd.fly(launch((25, 0, 8)), BALL, air, plane=near).status == "at-plane"
    landed = kd.fly(launch((25, 0, 8)), BALL, air, plane=far)
    assert landed.status == "landed"
    assert landed.landing.position[2] == 0
    assert kd.fly(launch((25, 0, 8)), BALL, air, plane=far, time_limit=0.1).status == "aloft"
    behind = kd.Plane((-5, 0, 0), (1, 0, 0))
    assert kd.fly(launch((25, 0, 8)), BALL, air, plane=behind).status == "landed"


@every_air
def test_a_start_on_the_plane(air):
    """It ends at once if the ball goes in or is pulled in, else the ball flies away."""
    at = (10 - R, 0, 0)
    into = kd.fly(launch((5, 0, 9), at), BALL, air, plane=WALL)
    assert (into.status, into.duration, into.range, into.height) == ("at-plane", 0, 0, 0)
    away = kd.fly(launch((-5, 0, 9), at), BALL, air, plane=WALL)
    assert away.status == "landed"
    assert away.range > 5
    ceiling, floor = (kd.Plane((0, 0, s * R), (0, 0, -s)) for s in (1, -1))
    under, on = (
        kd.fly(launch((5, 0, 0), (0, 0, 0)), BALL, air, kd.Ground(-3), plane=plane)
        for plane in (ceiling, floor)
    )
    assert (under.status, on.status, on.duration) == ("landed", "at-plane", 0)
    along = kd.Plane((0, 0, 0), (0, 1, 0), "centre")  # flown in, neither in nor out
    assert kd.fly(launch((5, 0, 9)), BALL, air, plane=along).status == "landed"


def test_a_ball_blown_back_to_the_wall_it_left():
    gale = kd.Air(wind=(25, 0, 0))
    path = kd.fly(launch((-5, 0, 15), (10 - R, 0, 0)), BALL, gale, plane=WALL)
    assert path.status == "at-plane"
    assert path.duration > 0.5
    assert path.landing.velocity[0] > 0


@pytest.mark.parametrize("tol", [1e-2, 1e-5, 1e-9])
def test_a_ball_that_grazes_a_wall_within_a_step(tol):
    side = kd.Air(wind=(0, -12, 0))
    state = launch((15, 4, 14))
    free = kd.fly(state, BALL, side, tol=1e-12)
    y = free.sample(np.linspace(0, free.duration, 20_001)).position[:, 1]
    most = y.max()
    assert y[0] < most > y[-1] + 1  # out and back
    for reach, status in ((most - 1e-3, "at-plane"), (most + 0.1, "landed")):
        plane = kd.Plane((0, reach, 0), (0, -1, 0), "centre")
        path = kd.fly(state, BALL, side, tol=tol, plane=plane)
        assert path.status == status
    touched = kd.fly(
        *(state, BALL, side, None, tol),
        plane=kd.Plane((0, most - 1e-3, 0), (0, -1, 0), "centre"),
    )
    assert touched.landing.position[1] == pytest.approx(most - 1e-3, abs=1e-12)
    assert touched.landing.velocity[1] > 0


def test_a_crest_after_the_wall_is_none():
    """A step may cross the wall first and the top later; the ball then never was at the top."""
    state = launch((25, 0, 0), (0, 0, 2), (0, -150, 0))  # dips or climbs all the way
    climbing = launch((20, 0, 12))
    for start in (state, climbing):
        top = kd.fly(start, BALL, kd.Air(), kd.Ground(-5), tol=1e-12).apex
        for short in (0.01, 0.1, 0.5):
            x = float(top.position[0]) - short
            wall = kd.Plane((x, 0, 0), (-1, 0, 0), "centre")
            for tol in (1e-2, 1e-3, 1e-6):
                path = kd.fly(start, BALL, kd.Air(), kd.Ground(-5), tol, plane=wall)
                assert path.apex.time <= path.duration
                assert path.apex.position[0] <= x + 1e-12


def test_the_error_at_a_plane_is_estimated():
    rng = np.random.default_rng(3)
    for _ in range(30):
        state = launch(rng.normal(size=3) * 2 + [22, 0, 9], spin=rng.normal(size=3) * 30)
        tol = 10 ** rng.uniform(-10, -4)
        plane = kd.Plane((rng.uniform(2, 8), 0, 0), (-1, 0.2, 0.1))
        path, exact = (kd.fly(state, BALL, kd.Air(), tol=t, plane=plane) for t in (tol, 1e-13))
        assert path.status == "at-plane"
        true = np.linalg.norm(path.landing.position - exact.landing.position)
        assert true <= path.error


# --- on the ground ------------------------------------------------------------------------------

TURF = kd.Ground(surface="turf")


@pytest.mark.parametrize("x", [12.0, 30.0, 45.0, 60.0])
def test_a_course_ends_at_the_goal_line(x):
    line = kd.Plane((x, 0, 0), (-1, 0, 0), "back")
    shot = launch((20, 1, 10), (0, 0, R), (5, -30, 10))
    whole = kd.follow(shot, BALL, kd.Air(), TURF)
    course = kd.follow(shot, BALL, kd.Air(), TURF, plane=line)
    if whole.rest.position[0] < x + R:
        assert course.status == "at-rest"
        assert course.rest.position == pytest.approx(whole.rest.position, abs=1e-7)
        return
    assert course.status == "at-plane"
    assert course.rest.position[0] == pytest.approx(x + R, abs=1e-12)
    assert course.rest.velocity[0] > 0
    there = whole.sample(course.duration)
    assert there.position == pytest.approx(course.rest.position, abs=1e-6)
    end = course.sample(course.duration)
    assert end.velocity == pytest.approx(course.rest.velocity, abs=1e-9)


def test_rolling_to_a_wall_has_a_closed_form():
    lane = kd.Ground(surface=Surface("lane", 0.0, 1.0, 0.8))
    rolling = launch((5, 2, 0), (0, 0, R), (-2 / R, 5 / R, 0))
    wall = kd.Plane((4 + R, 0, 0), (-1, 0, 0))
    course = kd.follow(rolling, BALL, None, lane, plane=wall)
    speed = math.hypot(5, 2)
    way = 4 * speed / 5
    left = math.sqrt(speed**2 - 2 * 0.8 * way)
    assert course.status == "at-plane"
    assert course.ground_phases[-1].kind == "roll"
    assert course.duration == pytest.approx((speed - left) / 0.8, rel=1e-9)
    assert course.rest.position == pytest.approx([4, 4 * 2 / 5, R], rel=1e-9)
    assert course.rest.velocity == pytest.approx(left / speed * np.array([5, 2, 0]), rel=1e-8)
    assert course.rest.spin == pytest.approx([-left / speed * 2 / R, left / speed * 5 / R, 0])


def test_sliding_to_a_wall_has_a_closed_form():
    ice = kd.Ground(surface=Surface("ice", 0.0, 0.1, 0.5))
    wall = kd.Plane((3 + R, 0, 0), (-1, 0, 0))
    course = kd.follow(launch((8, 0, 0), (0, 0, R)), BALL, None, ice, plane=wall)
    left = math.sqrt(64 - 2 * 0.981 * 3)
    assert course.status == "at-plane"
    assert [phase.kind for phase in course.ground_phases] == ["slide"]
    assert course.duration == pytest.approx((8 - left) / 0.981, rel=1e-12)
    assert course.rest.velocity == pytest.approx([left, 0, 0], rel=1e-12)
    assert course.rest.position[0] == pytest.approx(3, rel=1e-12)
