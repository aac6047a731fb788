"""Strikes with one source changed a little, for derivatives by differences."""

import numpy as np
import pinocchio as pin

import kickdyn as kd


def nudged(kick, options, name, step):
    """The same strike with one source changed by `step`, shape `(n,)`; constraints hold."""
    (posture, v, ball, contact), options = kick, dict(options)
    leg, q, normal, e = posture.leg, posture.q, contact.normal, contact.restitution
    change = {name: float(step[0])}.get  # of a source that is a number
    if name == "q":
        q = leg.close_loops(pin.integrate(leg.model, q, step))
        v = leg.posture(q).admissible(v)
    elif name == "v":
        v = leg.posture(q).admissible(v + step)
    elif name == "normal":
        normal = normal + step
    elif name in options:
        options[name] = options[name] + step
    elif name == "link_mass":
        leg = reweighed(leg, step)
    more = change("restitution", 0.0)
    e = [(u, value + more) for u, value in e] if isinstance(e, tuple) else e + more
    ball = kd.Ball(ball.mass + change("ball_mass", 0.0), ball.radius + change("ball_radius", 0.0))
    contact = kd.Contact(normal, e, contact.friction + change("friction", 0.0))
    return kd.strike(leg.posture(q), v, ball, contact, **options)


def reweighed(leg, step):
    """The leg with other masses of links at the same shape, and the same constraints."""
    model = leg.model
    for i in range(1, model.njoints):
        numbers = model.inertias[i].toDynamicParameters()
        if numbers[0]:
            numbers *= 1 + step[i - 1] / numbers[0]
        model.inertias[i] = pin.Inertia.FromDynamicParameters(numbers)
    new = kd.Leg(model, leg.frame).with_stiff_joints(*leg.stiff_joints)
    return new.with_loops(*leg.loops).with_supports(*leg.supports)


def margin(impact):
    """Friction impulse that remains until the points slip, or the speed of their sliding."""
    n, p, mu = impact.contact.normal, impact.impulse, impact.contact.friction
    if mu == 0:
        return 0.0
    if impact.sticking:
        return mu * float(n @ p) - np.linalg.norm(p - (n @ p) * n)
    state, foot = impact.ball_after, impact.posture.point_velocity(impact.v_after)
    after = state.velocity - impact.ball.radius * np.cross(state.spin, n) - foot
    return np.linalg.norm(after - (n @ after) * n)


RESULTS = {
    "impulse": lambda impact: impact.impulse,
    "velocity": lambda impact: impact.ball_after.velocity,
    "spin": lambda impact: impact.ball_after.spin,
    "v_after": lambda impact: impact.v_after,
    "joint_impulses": lambda impact: impact.joint_impulses,
    "margin_slope": lambda impact: np.array([margin(impact)]),
}


def by_differences(kick, options, name, direction, h=1e-4):
    """Derivatives along a direction, by central differences of fourth order; and the impacts."""
    impacts = [nudged(kick, options, name, k * h * direction) for k in (-2, -1, 1, 2)]
    slopes = {}
    for result, read in RESULTS.items():
        a, b, c, d = (read(impact) for impact in impacts)
        slopes[result] = (a - 8 * b + 8 * c - d) / (12 * h)
    return slopes, impacts
