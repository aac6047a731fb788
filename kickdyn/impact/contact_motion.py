r"""Relative motion of ball and foot at their contact, and friction, with floats alone.

A single contact runs these functions as they are, machine code for each lane of a batch.

All vectors are tuples in the contact's axes, which are fixed to the foot: two tangents of its plane
and the normal :math:`n = e_3` into the ball. The foot turns with :math:`\omega` about the origin of
its joint, which moves with :math:`v_J`; the ball's centre moves with :math:`v_b` and turns with
:math:`\omega_b`.
"""

import math

import numpy as np

from kickdyn.core.lanes import inlined, jitable
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

    with the height :math:`h = \rho_3` of the centre over the plane.

    Args:
        reach: :math:`\rho`, from the contact point of the foot to the ball's centre [m].
        arm: a, from the joint's origin to the contact point of the foot [m].
        ball: :math:`v_b` [m/s].
        ball_spin: :math:`\omega_b` [rad/s].
        foot: :math:`v_J` [m/s].
        spin: :math:`\omega` [rad/s].
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

    Args:
        height: h [m].
        point: p [m].
        relative: w [m/s].
        ball: :math:`v_b` [m/s].
        ball_spin: :math:`\omega_b` [rad/s].
        spin: :math:`\omega` [rad/s].
        bias: linear part a of the foot's spatial acceleration at the joint's origin with joints
            that do not accelerate [m/s2].
        turn_bias: its angular part :math:`\alpha` [rad/s2].
        gravity: g [m/s2].
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
    """Return whether points slide at the beginning of a phase.

    Args:
        speed: of the sliding [m/s].
        resting: speed up to which points are at rest [m/s].
        turned: whether the phase before ended because the sliding turned or stopped.
        left: largest friction, less the one that stops the points [N].
    """
    return speed > (TURNING_RATIO if turned and left > 0.0 else 2.0) * resting


@inlined
def sticking_force(
    mobility: Vector, free: tuple[float, float], rate: float, w1: float, w2: float
) -> tuple[float, float]:
    r"""Return the friction s with which :math:`G s + b = -\alpha w`, so that sliding w decays.

    Args:
        mobility: :math:`G_{11}, G_{12}, G_{22}` of leg and ball along the tangents [1/kg].
        free: b, acceleration of the sliding without friction [m/s2].
        rate: :math:`\alpha` [1/s].
        w1: sliding along the first tangent [m/s].
        w2: sliding along the second one [m/s].
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
