r"""Relative motion of ball and foot at their contact, friction, phases, and control of steps.

A single contact runs these functions as they are, with floats alone; machine code runs them for
each lane of a batch.

Vectors are tuples in the contact's axes, which are fixed to the foot: two tangents of its plane and
the normal :math:`n = e_3` into the ball. The foot turns with :math:`\omega` about the origin of its
joint, which moves with :math:`v_J`; the ball's centre moves with :math:`v_b` and turns with
:math:`\omega_b`.

The forces are smooth in every phase: one ends if compression does (end 0), or restitution at
separation (end 0) or where the deflection outgrows the largest one before (end 1), and where the
friction changes its kind (end 2). A step that a phase ends in is taken anew, by a secant, until it
ends just after that.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import math
from typing import Any

import numpy as np

from kickdyn.core.dop853 import STAGES
from kickdyn.core.lanes import BATCH, inlined, jitable
from kickdyn.core.validation import Array
from kickdyn.impact.contact_problem import tangents

Vector = tuple[float, float, float]

TURNING_RATIO = 20.0
"""Sliding speed, over the speed of points at rest, up to which a sliding that turns is about to
stop: its direction changes faster than an explicit integrator follows."""


def contact_axes(normal: Array, sliding: Array | None = None) -> Array:
    """Return tangents and normal as columns; the first tangent is along `sliding`, if not 0."""
    x, y, z = (0.0, 0.0, 0.0) if sliding is None else sliding.tolist()
    a, b, c = normal.tolist()
    first, second = tangents((a, b, c), (x, y, z))
    return np.column_stack([first, second, normal])


@inlined
def contact_motion(
    reach: Vector, arm: Vector, ball: Vector, ball_spin: Vector, foot: Vector, spin: Vector
) -> tuple[Vector, Vector]:
    r"""Return the point p of the foot's plane nearest to the ball's centre, and the velocity w.

    .. math:: p = a + \rho - h n, \qquad w = v_b - h\, \omega_b \times n - v_J - \omega \times p,

    with :math:`\rho`, from the contact point of the foot to the ball's centre, whose height over
    the plane is :math:`h = \rho_3`, and the arm a from the joint's origin to the contact point [m].
    """
    x, y, z = reach[0] + arm[0], reach[1] + arm[1], arm[2]
    relative = (
        ball[0] - reach[2] * ball_spin[1] - (foot[0] + spin[1] * z - spin[2] * y),
        ball[1] + reach[2] * ball_spin[0] - (foot[1] + spin[2] * x - spin[0] * z),
        ball[2] - (foot[2] + spin[0] * y - spin[1] * x),
    )
    return (x, y, z), relative


@inlined
def free_sliding(
    height: float, point: Vector, relative: Vector, ball: Vector, ball_spin: Vector,
    spin: Vector, bias: Vector, turn_bias: Vector, gravity: Vector,
) -> tuple[float, float]:  # fmt: skip
    r"""Return the acceleration of the sliding :math:`(w_1, w_2)` without any force [m/s2].

    It is the derivative of w in the turning axes, :math:`\dot w - \omega \times w`, where

    .. math:: \dot w = g - \dot h\, \omega_b \times n - h\, \omega_b \times (\omega \times n)
        - a - \omega \times v_J - \alpha \times p - \omega \times \dot p, \qquad
        \dot p = v_b - \dot h n - h\, \omega \times n - v_J, \qquad \dot h = w_3 .

    Point p and `relative` velocity w are as of `contact_motion`. The foot's spatial acceleration at
    the joint's origin, with joints that do not accelerate, has the linear part a, the `bias`
    [m/s2], and the angular part :math:`\alpha`, the `turn_bias` [rad/s2].
    """
    x, y, z = point
    a, b, c = spin
    rise = relative[2]
    # of what omega turns: p' + w + v_J
    u, v = ball[0] - height * b + relative[0], ball[1] + height * a + relative[1]
    w = ball[2]
    p, q, r = turn_bias
    first = gravity[0] - rise * ball_spin[1] - height * ball_spin[2] * a
    second = gravity[1] + rise * ball_spin[0] - height * ball_spin[2] * b
    return (
        first - bias[0] - (q * z - r * y) - (b * w - c * v),
        second - bias[1] - (r * x - p * z) - (c * u - a * w),
    )


def free_rise(
    height: float, point: Vector, relative: Vector, ball: Vector, ball_spin: Vector,
    spin: Vector, bias: Vector, turn_bias: Vector, gravity: Vector,
) -> float:  # fmt: skip
    r"""Return :math:`\ddot h` without any force [m/s2], with the arguments of `free_sliding`.

    The spin of the ball does not change h, so that :math:`h\, \omega_b \times n` is left out.
    """
    x, y, _ = point
    a, b, _ = spin
    u = ball[0] - height * b + relative[0] + height * ball_spin[1]
    v = ball[1] + height * a + relative[1] - height * ball_spin[0]
    return gravity[2] - bias[2] - (turn_bias[0] * y - turn_bias[1] * x) - (a * v - b * u)


@inlined
def slipping_force(
    largest: float, along: tuple[float, float], w1: float, w2: float
) -> tuple[float, float]:
    """Return the friction on a ball whose contact point slides with velocity w, at most a size.

    A sliding against the direction `along`, in which it began, is mirrored: the integrator of a
    phase may go beyond its end, where the friction stays as smooth as before it.
    """
    forward = along[0] * w1 + along[1] * w2
    if forward < 0.0:
        w1, w2 = w1 - 2.0 * forward * along[0], w2 - 2.0 * forward * along[1]
    speed = math.sqrt(w1 * w1 + w2 * w2)
    share = largest / speed if speed > 0.0 else 0.0
    return -share * w1, -share * w2


@inlined
def slip_end(along: tuple[float, float], w1: float, w2: float, resting: float) -> float:
    """Return the value that is 0 where points stop sliding in about their first direction."""
    forward = along[0] * w1 + along[1] * w2
    return forward - max(resting, 0.5 * math.sqrt(w1 * w1 + w2 * w2))


@inlined
def slides(speed: float, resting: float, turned: bool, left: float) -> bool:
    """Return whether points slide at the beginning of a phase; up to `resting` they are at rest.

    `turned` says whether the phase before ended because the sliding turned or stopped; `left` is
    the largest friction, less the one that stops the points [N].
    """
    return speed > (TURNING_RATIO if turned and left > 0.0 else 2.0) * resting


@inlined
def sticking_force(
    mobility: Vector, free: tuple[float, float], rate: float, w1: float, w2: float
) -> tuple[float, float]:
    r"""Return the friction s with which :math:`G s + b = -\alpha w`, so that sliding w decays.

    G has the entries 11, 12 and 22 of the `mobility` along the tangents [1/kg]; b is the `free`
    acceleration, without friction [m/s2].
    """
    g11, g12, g22 = mobility
    r1, r2 = free[0] + rate * w1, free[1] + rate * w2
    determinant = g11 * g22 - g12 * g12
    return (g12 * r2 - g22 * r1) / determinant, (g12 * r1 - g11 * r2) / determinant


@jitable
def slip_direction(a11: float, a12: float, a22: float, g1: float, g2: float) -> Vector:
    r"""Return the unit vector d of the friction on points that begin to slip, and their gain k.

    The friction :math:`\mu p_3 d` opposes the sliding velocity :math:`A d + g`, with :math:`A = \mu
    p_3 G` along the tangents: :math:`(A + k) d = -g` with :math:`k \ge 0`. The length of d
    decreases with k and is above 1 at 0, where the points would stick, so that one k makes it 1.
    Newton's method on its inverse, which is concave, comes to that from below (Conn, Gould and
    Toint, Trust-Region Methods, 2000, chapter 7). It starts above 0, where A may be singular.
    Without g, d is 0.
    """
    if g1 == 0.0 and g2 == 0.0:
        return 0.0, 0.0, 0.0
    k = max(1e-15 * (a11 + a22), math.sqrt(g1 * g1 + g2 * g2) - (a11 + a22))
    x, y, size = 0.0, 0.0, 1.0
    for _ in range(60):
        b11, b22 = a11 + k, a22 + k
        determinant = b11 * b22 - a12 * a12
        x, y = (a12 * g2 - b22 * g1) / determinant, (a12 * g1 - b11 * g2) / determinant
        size = math.sqrt(x * x + y * y)
        decrease = (x * (b22 * x - a12 * y) + y * (b11 * y - a12 * x)) / determinant
        step = (size - 1.0) * size * size / decrease
        k += step
        if not step > 1e-16 * k:
            break
    return x / size, y / size, k


STARTING = 1e-5
"""Sliding speed, relative to the speed of the approach or of the sliding at first contact, up to
which points that begin to slide count as `STARTS`: their direction of sliding changes faster than
an explicit integrator follows."""

RESTING = 10.0
"""Sliding speed up to which points are at rest, relative to the same speed times the tolerance of
the integrator, which is the error of a sliding that stops."""

STABILIZATION_RATE = 10.0
"""Rate at which errors of supports, loops and sticking decay, over the expected contact time."""

MAX_EVALUATIONS = 60_000
"""Evaluations of the equations of motion of one contact; ordinary contacts take some hundreds."""

MAX_CONTACT_TIMES = 50.0
"""Expected contact times after which foot and ball count as not separating."""

FIRST_STEP = 3.0
"""First step over the expected contact time, per tolerance of the integrator to the power 2/7: the
error that a step leaves where the force begins as the deflection to the power 3/2."""

BEYOND_END = 1.02
"""Longest step over the time to separation at the present speed: the force ends there at once."""

BRIEF = 0.02, 1e-4
"""Time in which points come to rest, relative to the expected contact time, that one step may go
beyond: where they slide straight, and where they turn, which takes ever shorter steps."""

NARROW = 1e-9
"""Bracket of the end of a phase, relative to the step, in which rounding may decide the sign."""

PLACE_ROUNDING = 1e-14
"""Error of the deflection [m] that rounding of the places of foot and ball, a metre from the first
joint, and of what follows from them explains."""

SLIPS, STICKS, STARTS = 0.0, 1.0, 2.0
"""Kinds of friction: points slide, and friction opposes the sliding; friction stops them; they are
about to slide, and friction opposes the direction in which the sliding grows."""

LANE = np.dtype(
    [
        ("axes", float, (9, BATCH)),  # tangents and normal in the frame of the foot's joint
        ("arm", float, (3, BATCH)),  # from that joint to the contact point, along the axes [m]
        ("centre", float, (3, BATCH)),  # of the ball at first contact, from the first joint [m]
        ("inverse_mass", float, BATCH),  # of the ball [1/kg]
        ("inverse_inertia", float, BATCH),  # of the ball [1/(kg m2)]
        ("radius", float, BATCH),  # [m]
        ("friction", float, BATCH),
        ("stiffness", float, BATCH),  # of the spring [N/m^n]
        ("share", float, BATCH),  # square of the restitution
        ("exponent", float, BATCH),  # n
        ("rate", float, BATCH),  # at which the sliding of points that stick decays [1/s]
        ("resting", float, BATCH),  # speed of points at rest [m/s]
        ("starting", float, BATCH),  # speed of points that begin to slide [m/s]
        ("speed", float, BATCH),  # of the approach [m/s]
        ("expected", float, BATCH),  # contact time of the two masses alone [s]
        ("first_step", float, BATCH),  # [s]
        ("tolerance_factor", float, BATCH),  # tolerance of its error over the integrator's
        ("energy", float, BATCH),  # of the approach [J]
        ("spin", float, BATCH),  # scale of the ball's spin [rad/s]
        ("kind", float, BATCH),  # of friction
        ("along", float, (2, BATCH)),  # direction of the sliding as the phase begins
        ("largest", float, BATCH),  # deflection so far, 0 while it grows [m]
        ("height", float, BATCH),  # of the ball's centre over the plane of the foot [m]
        ("sliding", float, (3, BATCH)),  # velocity of the ball over the foot [m/s]
        ("free", float, (2, BATCH)),  # its derivative without forces or joints that accelerate
        ("pushed", float, (2, BATCH)),  # acceleration of the contact point without contact
        ("force", float, (3, BATCH)),  # on the ball [N]
        ("lost", float, BATCH),  # power [W]
        ("deflection", float, BATCH),  # [m]
        ("ends", float, (3, BATCH)),  # values that fall to 0 at the ends of the phase
        ("reserve", float, BATCH),  # largest friction, less the one that stops the points [N]
        ("most", float, BATCH),  # largest friction [N]
        ("rest", float, BATCH),  # longest step of points that come to rest [s]
        ("time", float, BATCH),  # since first contact [s]
        ("step", float, BATCH),  # [s]
        ("whole", float, BATCH),  # last step that no phase ended in [s]
        ("before", float, BATCH),  # energy at first contact [J]
        ("low", float, BATCH),  # a bracket of the step to the end of a phase [s],
        ("low_value", float, BATCH),  # with the values there
        ("high", float, BATCH),
        ("high_value", float, BATCH),
        ("which", float, BATCH),  # end that the bracket has
        ("rejected", float, BATCH),  # 1 after a rejected step
        ("calls", float, BATCH),  # evaluations
        ("begin", float, (3, BATCH)),  # `ends` at the beginning of the step
    ]
)
"""A contact: its constants, its forces at the last evaluation, and the state of its integration."""

LANE_NAMES: tuple[str, ...] = LANE.names or ()

GIVEN: tuple[str, ...] = LANE_NAMES[: LANE_NAMES.index("largest")]
"""Fields of a lane that do not begin at 0."""

TAKEN, AGAIN, FAILED, THROUGH = -1, -2, -3, -4
"""Outcomes of a step: it is taken, or to be taken anew; the integration failed, or the foot reaches
the centre of the ball. Others are the number of the end of the phase, plus `AT_BEGINNING` if the
phase has ended at the beginning of the step, which is then not taken."""

AT_BEGINNING = 10


def set_lanes(
    lane: Any, speed: Any, mass: Any, sliding: Any, spring: tuple[Any, float, Any, Any],
    spin: Any, tol: float,
) -> None:  # fmt: skip
    """Fill in the constants of n lanes that follow from the motion at first contact.

    They are speed of approach [m/s], reduced mass along the normal [kg], sliding along both
    tangents `(2, n)` [m/s], largest component of the ball's spin [rad/s]; and of the spring,
    stiffness [N/m^n], exponent, restitution and expected contact time [s].
    """
    stiffness, exponent, restitution, time = spring
    lane.stiffness[:], lane.exponent[:], lane.share[:] = stiffness, exponent, restitution**2
    lane.rate[:], lane.expected[:], lane.speed[:] = STABILIZATION_RATE / time, time, speed
    lane.tolerance_factor[:] = np.maximum(1.0, PLACE_ROUNDING / (tol * speed * time))
    lane.energy[:] = 0.5 * mass * speed * speed
    lane.first_step[:] = lane.step[:] = time * min(FIRST_STEP * tol ** (2 / 7), 0.3)
    lane.spin[:] = np.where(spin > 0.0, spin, speed / lane.radius)
    size = np.hypot(*sliding)
    fastest = np.maximum(speed, size)
    lane.resting[:], lane.starting[:] = RESTING * tol * fastest, STARTING * fastest
    slips = size > 2.0 * lane.resting
    lane.kind[:] = np.where(slips, SLIPS, STARTS)
    lane.along[:] = np.where(slips, sliding / np.where(slips, size, 1.0), 0.0)


def light_contact_factor(lane: Any, impulse: Any, mass: Any, deflection: Any, tol: float) -> Any:
    """Return `tolerance_factor` of contacts with a small impulse, whose foot recedes from the ball.

    Their first integration has an error relative to the impulse that stops the approach. A second
    one has it relative to their own impulse [N s], unless rounding of the largest deflection [m] is
    larger. The mass is the reduced one [kg].
    """
    share = impulse / (mass * lane.speed)
    least = share * np.maximum(1.0, PLACE_ROUNDING / (tol * deflection))
    return np.where(share < 0.1, np.minimum(least, lane.tolerance_factor), lane.tolerance_factor)


@inlined
def friction_force(lane, i, size, mobility, free):
    """Return the friction on ball i under a normal force of a size [N]; fill in what ends its kind.

    `mobility` and `free` are those of `sticking_force`.
    """
    most, kind = lane.friction[i] * size, lane.kind[i]
    w1, w2 = lane.sliding[0, i], lane.sliding[1, i]
    f1, f2, end, reserve, rest = 0.0, 0.0, math.inf, math.inf, math.inf
    if lane.friction[i] > 0.0:
        s1, s2 = sticking_force(mobility, free, lane.rate[i], w1, w2)
        reserve = most - math.sqrt(s1 * s1 + s2 * s2)
        if kind == SLIPS:
            along = lane.along[0, i], lane.along[1, i]
            f1, f2 = slipping_force(most, along, w1, w2)
            end = slip_end(along, w1, w2, lane.resting[i])
            a1 = free[0] + mobility[0] * f1 + mobility[1] * f2
            a2 = free[1] + mobility[1] * f1 + mobility[2] * f2
            slowing, turning = w1 * a1 + w2 * a2, w1 * a2 - w2 * a1
            rest = (w1 * w1 + w2 * w2) / -slowing if slowing < 0.0 else math.inf
            brief = BRIEF[0] if abs(turning) < 1e-3 * abs(slowing) else BRIEF[1]
            rest *= BEYOND_END if rest < brief * lane.expected[i] else 0.75
        elif kind == STICKS:
            f1, f2, end = s1, s2, reserve
        else:
            d1, d2, _ = slip_direction(
                most * mobility[0], most * mobility[1], most * mobility[2], free[0], free[1]
            )
            f1, f2 = most * d1, most * d2
            slowest = lane.starting[i] + 3.0 * lane.resting[i]
            end = min(slowest - math.sqrt(w1 * w1 + w2 * w2), -reserve)
    lane.most[i], lane.reserve[i], lane.rest[i], lane.ends[2, i] = most, reserve, rest, end
    return f1, f2


@inlined
def put_forces(lane, i, force, loss, deflection, separation):
    """Fill in force on the ball [N], power lost and deflection, and the ends of a phase they make.

    `loss` is the power that the normal force loses [W], and `separation` the deflection at which
    the force vanishes [m].
    """
    lane.force[0, i], lane.force[1, i], lane.force[2, i] = force
    lane.lost[i] = loss - force[0] * lane.sliding[0, i] - force[1] * lane.sliding[1, i]
    lane.deflection[i] = deflection
    if lane.largest[i] == 0.0:
        lane.ends[0, i], lane.ends[1, i] = -lane.sliding[2, i], math.inf
    else:
        lane.ends[0, i], lane.ends[1, i] = deflection - separation, lane.largest[i] - deflection


@inlined
def limit_step(lane, i):
    """Let a step of restitution end shortly after separation at the present speed.

    And a step of points that slide shortly before they come to rest, where their direction may
    change, or shortly after that if it is brief.
    """
    lane.begin[0, i], lane.begin[1, i] = lane.ends[0, i], lane.ends[1, i]
    lane.begin[2, i] = lane.ends[2, i]
    largest, deflection, e = lane.largest[i], lane.deflection[i], math.sqrt(lane.share[i])
    if lane.high[i] > 0.0:
        return
    lane.step[i] = min(lane.step[i], lane.rest[i])
    if largest == 0.0:
        return
    leaving, remaining = lane.sliding[2, i], 0.5 * lane.expected[i] * e / (1.0 + e)
    if deflection < 0.99 * largest and leaving > 0.0:
        remaining = lane.ends[0, i] / leaving
    least = 1e-9 * MAX_CONTACT_TIMES * lane.expected[i]
    lane.step[i] = min(lane.step[i], max(BEYOND_END * remaining, least))


@inlined
def _precision(lane, i, which, precision):
    """Return the accepted distance beyond 0 of the value that ends a phase.

    `precision` is relative. The forces change continuously there, except where points come to rest.
    """
    precision = max(precision, min(precision * lane.tolerance_factor[i], 1e-6))
    if which == 0 and lane.largest[i] == 0.0:
        return precision * lane.speed[i]
    if which < 2:
        return precision * lane.largest[i]
    if lane.kind[i] == SLIPS:
        return lane.resting[i]
    if lane.kind[i] == STARTS and lane.ends[2, i] != -lane.reserve[i]:
        return 5.0 * lane.starting[i]
    return precision * lane.most[i]


@inlined
def _next_trial(lane, i):
    """Put the next length of a step that is to end just after the end of a phase."""
    low, high = lane.low[i], lane.high[i]
    above, below = lane.low_value[i], lane.high_value[i]
    if low == 0.0 and lane.which[i] == 2.0 and lane.kind[i] == STARTS:
        slowest = lane.starting[i]  # the sliding grows with the square of the time
        lane.step[i] = high * max(math.sqrt(2.0 * slowest / (slowest - below)), 1e-3)
    elif above > 0.0:
        share = above / (above - below)
        lane.step[i] = low + min(max(share, 0.001), 0.999) * (high - low)
    else:  # as where the phase begins with 0
        lane.step[i] = low + 0.1 * (high - low)


@inlined
def _first_end(lane, i):
    """Return which end a step falls into first, by a secant; -1 for none."""
    which, earliest = -1, math.inf
    for k in range(3):
        end, begin = lane.ends[k, i], lane.begin[k, i]
        if end <= 0.0:
            about = max(begin, 0.0) / (max(begin, 0.0) - end) if end < 0.0 else 1.0
            if about < earliest:
                which, earliest = k, about
    return which


@inlined
def _end_step(lane, i, error, precision):
    """Return the outcome of a step with an error, 1 at most, and a precision of the ends."""
    h, doubtful = lane.step[i], lane.calls[i] > MAX_EVALUATIONS
    if doubtful or h < 1e-13 * lane.expected[i]:
        return FAILED
    if not error < 1.0:
        factor = max(0.2, 0.9 / math.sqrt(math.sqrt(math.sqrt(error)))) if error < 1e30 else 0.2
        lane.step[i], lane.rejected[i], lane.high[i] = h * factor, 1.0, 0.0
        return AGAIN
    which, trying = _first_end(lane, i), lane.high[i] > 0.0
    if which < 0 and lane.height[i] <= 1e-9 * lane.radius[i]:
        return THROUGH
    if which < 0 and not trying:
        return TAKEN
    if which < 0:  # before the end that is sought
        seek = int(lane.which[i])
        value = lane.ends[seek, i] + 0.5 * _precision(lane, i, seek, precision)
        if lane.low_value[i] > 0.0:  # Anderson and Bjorck's weight of the end that stays
            weight = 1.0 - value / lane.low_value[i]
            lane.high_value[i] *= weight if weight > 0.0 else 0.5
        lane.low[i], lane.low_value[i] = h, value
        _next_trial(lane, i)
        if lane.high[i] - h < NARROW * h:
            lane.step[i] = lane.high[i]
        return AGAIN
    value, accepted = lane.ends[which, i], _precision(lane, i, which, precision)
    if value >= -accepted:
        return which
    if h < 1e-6 * lane.first_step[i] and lane.begin[which, i] <= 0.0:
        return which + AT_BEGINNING
    known = trying and which == int(lane.which[i])
    if known and h - lane.low[i] < NARROW * h:
        return which
    if not known:
        begin = lane.begin[which, i]
        lane.low[i], lane.low_value[i] = 0.0, begin + 0.5 * accepted if begin > 0.0 else 0.0
    elif lane.low_value[i] > 0.0:
        weight = 1.0 - (value + 0.5 * accepted) / lane.high_value[i]
        lane.low_value[i] *= weight if weight > 0.0 else 0.5
    lane.high[i], lane.high_value[i] = h, value + 0.5 * accepted
    lane.which[i] = which
    _next_trial(lane, i)
    return AGAIN


@inlined
def finish_step(lane, i, error, precision):
    """Return the outcome of a step; move the time on, and put the length of the next step."""
    lane.calls[i] += STAGES + 1
    h, outcome = lane.step[i], _end_step(lane, i, error, precision)
    if outcome == TAKEN or 0 <= outcome < AT_BEGINNING:
        lane.time[i] += h
    if outcome == TAKEN:
        most = 1.0 if lane.rejected[i] > 0.0 else 10.0
        growth = 0.9 / math.sqrt(math.sqrt(math.sqrt(error))) if error > 1e-12 else most
        lane.whole[i], lane.rejected[i] = h, 0.0
        lane.step[i] = h * min(max(growth, 0.2), most)
        if lane.time[i] > MAX_CONTACT_TIMES * lane.expected[i]:
            outcome = FAILED
    elif outcome >= 0:
        lane.step[i] = max(lane.whole[i], lane.first_step[i])
        lane.high[i], lane.rejected[i] = 0.0, 0.0
    return outcome


@inlined
def begin_phase(lane, i, which):
    """Begin the next phase after an end of one, or return whether foot and ball part."""
    if which < 2:
        if which == 0 and lane.largest[i] > 0.0:
            return True
        lane.largest[i] = lane.deflection[i] if which == 0 else 0.0
        return False
    w1, w2, ended = lane.sliding[0, i], lane.sliding[1, i], lane.kind[i]
    speed = math.sqrt(w1 * w1 + w2 * w2)
    moves = slides(speed, lane.resting[i], ended == SLIPS, lane.reserve[i])
    if ended != STICKS and moves:
        lane.kind[i], lane.along[0, i], lane.along[1, i] = SLIPS, w1 / speed, w2 / speed
    elif ended == STICKS or (ended != STARTS and lane.reserve[i] < 0.0):
        lane.kind[i] = STARTS
    else:
        lane.kind[i] = STICKS
    return False


@inlined
def event_precision(tol):
    """Return the relative precision of the ends of phases for a tolerance of the integrator."""
    return max(min(0.1 * math.sqrt(tol), 100.0 * tol), 1e-9)
