"""Strikes with one source moved a little, for derivatives by differences."""

import numpy as np
import pinocchio as pin

import kickdyn as kd


def nudged(kick, options, name, step):
    """The same strike with one source moved by `step`, shape `(n,)`; what holds the leg holds."""
    (posture, v, ball, contact), options = kick, dict(options)
    leg, q = posture.leg, posture.q
    normal, e, mu, mass, radius = (
        contact.normal,
        contact.restitution,
        contact.friction,
        *vars_of(ball),
    )
    if name == "q":
        q = leg.close_loops(pin.integrate(leg.model, q, step))
        v = leg.posture(q).admissible(v)
    elif name == "v":
        v = leg.posture(q).admissible(v + step)
    elif name == "restitution":
        if isinstance(e, tuple):  # the whole table
            e = [(speed, value + float(step[0])) for speed, value in e]
        else:
            e += float(step[0])
    elif name == "friction":
        mu += float(step[0])
    elif name == "normal":
        normal = normal + step
    elif name == "ball_mass":
        mass += float(step[0])
    elif name == "ball_radius":
        radius += float(step[0])
    elif name in options:
        options[name] = options[name] + step
    else:
        leg = reweighed(leg, step)
    return kd.strike(leg.posture(q), v, kd.Ball(mass, radius), kd.Contact(normal, e, mu), **options)


def reweighed(leg, step):
    """The leg with other links, held as before."""
    model = leg.model
    for i in range(1, model.njoints):
        numbers = model.inertias[i].toDynamicParameters()
        if numbers[0]:
            numbers *= 1 + step[i - 1] / numbers[0]
        model.inertias[i] = pin.Inertia.FromDynamicParameters(numbers)
    new = kd.Leg(model, leg.frame)
    if leg.constraints and leg.constraints.loops:
        new = new.with_loops(*leg.constraints.loops)
    if leg.constraints and leg.constraints.supports:
        new = new.with_supports(*leg.constraints.supports)
    return new


def vars_of(ball):
    return ball.mass, ball.radius


def margin(hit):
    n, p, mu = hit.contact.normal, hit.impulse, hit.contact.friction
    if mu == 0:
        return 0.0
    if hit.sticking:
        return mu * float(n @ p) - np.linalg.norm(p - (n @ p) * n)
    foot = hit.posture.point_velocity(hit.v_after)
    after = hit.ball_after.velocity - hit.ball.radius * np.cross(hit.ball_after.spin, n) - foot
    return np.linalg.norm(after - (n @ after) * n)


RESULTS = {
    "impulse": lambda hit: hit.impulse,
    "velocity": lambda hit: hit.ball_after.velocity,
    "spin": lambda hit: hit.ball_after.spin,
    "v_after": lambda hit: hit.v_after,
    "joint_impulses": lambda hit: hit.joint_impulses,
    "margin_slope": lambda hit: np.array([margin(hit)]),
}


def by_differences(kick, options, name, way, h=1e-4):
    """Derivatives along `way`, by central differences of fourth order; and the hits."""
    hits = [nudged(kick, options, name, k * h * way) for k in (-2, -1, 1, 2)]
    slopes = {}
    for result, read in RESULTS.items():
        far, near, then, beyond = (read(one) for one in hits)
        slopes[result] = (far - 8 * near + 8 * then - beyond) / (12 * h)
    return slopes, hits
