"""Parameters of a MuJoCo contact with which a simulated kick gives the ball that kickdyn computes.

MuJoCo has no coefficient of restitution. Its contact is a spring and a damper per unit of mass,
which act once per time step and on a ball that has already entered the foot at the first of them.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.impact.approach import AT_REST, find_approach
from kickdyn.impact.force_model import CONTACT_TIME, LONGEST_CONTACT
from kickdyn.impact.strike import strike
from kickdyn.robot.leg import Posture
from kickdyn.simulators.mujoco_fit import (
    CONTACT_TIME_TOLERANCE,
    SPEEDS,
    KickError,
    MujocoGoal,
    MujocoIntegrator,
    find_best,
    find_error,
    find_goals,
    kick_cases,
    other_speed,
)
from kickdyn.simulators.mujoco_kick import MujocoContact, load_mujoco, pair, row, scene

LEAST_RESTITUTION = 0.2
"""Below about 0.14 a damped spring is overdamped, and has no contact time of its own."""

LONGEST_STEP = 0.02
"""Largest time step [s]."""

MOST_STEPS = 500
"""Of a contact: more would take minutes, and change no digit that the fit determines."""

LEAST_SPEED = 0.01
"""Least speed of approach [m/s]: below it gravity, not the impact, decides the motion."""


@dataclass(frozen=True, eq=False, repr=False)
class MujocoTuning(ReprMixin):
    """The contact parameters for MuJoCo that `tune_mujoco` finds.

    Attributes:
        solref: -stiffness [1/s2] and -damping [1/s] along the normal, per unit of mass.
        solimp: impedance at first contact and at depth, that depth [m], midpoint and power.
        friction: coefficient of sliding.
        solreffriction: the same two numbers across the normal, where MuJoCo reads only the damping;
            (0, 0) without friction. MuJoCo takes it for a `<pair>` of geoms only.
        margin: `margin` of the ball's geom, which is smaller than the ball by as much [m], so that
            friction acts at the surface of the foot; 0 without friction.
        timestep: time step of the simulation [s].
        integrator: integrator of MuJoCo.
        contact_time: mean contact time of the simulated kicks [s].
        wanted_contact_time: contact time that was asked for [s].
        errors: errors of the tuned kick; at other speeds; earlier and later in the swing; and of
            the tuned kick against the ball of `strike`, an impact without duration.
        tolerance: the largest error of the ball's speed that was asked for, relative.
        scene: MJCF model of leg and ball just before they touch.
        ball: the ball.
        ball_position: position of its centre at first contact, shape `(3,)` [m, world frame].
    """

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    friction: float
    solreffriction: tuple[float, float]
    margin: float
    timestep: float
    integrator: str
    contact_time: float
    wanted_contact_time: float
    errors: tuple[KickError, ...]
    tolerance: float
    scene: str
    ball: Ball
    ball_position: Array

    @property
    def condim(self) -> int:
        """Directions in which the contact has forces: 1 without friction, else 3."""
        return self.contact.condim

    @property
    def goals(self) -> tuple[MujocoGoal, ...]:
        """The errors that are judged, and their accepted sizes."""
        return find_goals(self.errors, self.tolerance)

    @property
    def within_tolerance(self) -> bool:
        """Whether all errors are accepted: no goal is missed."""
        return all(goal.met for goal in self.goals)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines about the ball, missed goals and the contact time."""
        lines = [*self.ball.warnings]
        around = f" at {min(SPEEDS):g} to {max(SPEEDS):g} times all velocities"
        lines += [
            f"with a time step of {1e3 * self.timestep:g} ms, the ball's {goal.name.split()[0]} is "
            f"off by up to {goal.texts[0]}{around * (goal.name == 'speed around')}, and at most "
            f"{goal.texts[1]} is accepted: choose a smaller time step"
            for goal in self.goals
            if not goal.met
        ]
        names = [error.change for error in self.errors]
        lines += [
            f"the error at {factor:g} times all velocities is unknown: kd.collide would press the "
            "ball in beyond its radius there; a shorter contact time avoids this"
            for factor in SPEEDS
            if other_speed(factor) not in names
        ]
        if abs(self.contact_time / self.wanted_contact_time - 1.0) > CONTACT_TIME_TOLERANCE:
            lines.append(
                f"the contact lasts {1e3 * self.contact_time:.3g} ms instead of the "
                f"{1e3 * self.wanted_contact_time:.3g} ms asked for"
            )
        return tuple(lines)

    def mjcf(self, *feet: str) -> str:
        """Return a model with the ball and its contact, for an `<include>` in a robot's MJCF.

        The ball is where the kick strikes it, in the world frame of the leg. The options are those
        on which the fit depends; they replace the options of the robot's file. Where that file has
        `inertiafromgeom="true"`, MuJoCo gives the ball the inertia of a shell, 2/3 m r^2.

        Args:
            feet: names of the geoms that strike the ball, `foot` by default; only a contact with
                friction names them.

        Raises:
            InvalidInput: a name that MJCF cannot have.
        """
        for foot in feet:
            validation.check_type(str, foot=foot)
            if not foot.isprintable() or set(foot) & set("<>&\"'") or not foot:
                raise InvalidInput(f"foot is {foot[:40]!r}: it must be the name of a geom")
        contact, ball, margin = self.contact, self.ball, self.margin
        inertia = row([ball.inertia] * 3)
        # for robots whose <compiler> takes inertias from geoms; kickdyn's balls are shells
        mass = f'mass="{ball.mass!r}" shellinertia="true"'
        inner, surface, pairs = mass, "", ""
        if margin:
            inner = 'mass="0"'
            surface = f"""
      <geom name="ball_surface" type="sphere" size="{ball.radius!r}" {mass}
        contype="0" conaffinity="0" rgba="1 1 1 0.4"/>"""
        if self.friction:
            elements = "\n    ".join(pair(contact, foot) for foot in feet or ("foot",))
            pairs = f"\n  <contact>\n    {elements}\n  </contact>"
        return f"""<mujoco>
  <option timestep="{self.timestep!r}" integrator="{self.integrator}" cone="elliptic" \
impratio="100" solver="Newton" tolerance="1e-10" iterations="100"/>
  <worldbody>
    <body name="ball" pos="{row(self.ball_position)}">
      <freejoint/>
      <inertial pos="0 0 0" mass="{ball.mass!r}" diaginertia="{inertia}"/>
      <geom name="ball" type="sphere" size="{ball.radius - margin!r}" margin="{margin!r}" {inner}
        contype="1" conaffinity="1" priority="1" condim="{self.condim}" \
friction="{float(self.friction)!r} 0 0"
        solref="{row(self.solref)}" solimp="{row(self.solimp)}"/>{surface}
    </body>
  </worldbody>{pairs}
</mujoco>
"""

    @property
    def contact(self) -> MujocoContact:
        """The parameters together, as a kick in MuJoCo takes them."""
        return MujocoContact(*(getattr(self, name) for name in MujocoContact._fields))

    def _rows(self) -> Iterable[Row]:
        yield "time step", 1e3 * self.timestep, f"ms, {self.integrator}"
        yield "solref", digits(self.solref), ""
        yield "solimp", digits(self.solimp), ""
        yield "condim", self.condim, ""
        if self.friction:
            yield "friction", self.friction, ""
            yield "solreffriction", digits(self.solreffriction), "(of a <pair>)"
            yield "margin", 1e3 * self.margin, "mm"
        asked = f"ms, {1e3 * self.wanted_contact_time:g} ms asked for"
        yield "contact time", 1e3 * self.contact_time, asked
        for error in self.errors:
            text = f"speed {error.speed:.2%}, direction {math.degrees(error.direction):.2f} deg"
            if self.friction:
                text += f", spin {error.spin:.2g} rad/s"
            yield f"error, {error.change or 'this kick'}", text, ""
        for goal in self.goals:
            name = goal.name.replace("around", f"x {min(SPEEDS):g} to {max(SPEEDS):g}")
            reached, limit = goal.texts
            yield f"goal, {name}", f"at most {limit}: {reached},", "met" if goal.met else "MISSED"
        yield "within tolerance", "yes" if self.within_tolerance else "no", ""
        yield from warned(self.warnings)


@validation.check_arguments
def tune_mujoco(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    *,
    timestep: float = 0.002,
    integrator: str = "implicitfast",
    contact_time: float = CONTACT_TIME,
    tolerance: float = 0.03,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
) -> MujocoTuning:
    r"""Find the contact parameters with which MuJoCo launches the ball as kickdyn does.

    Needs MuJoCo: `pip install "kickdyn[mjcf]"`. The kick is fitted to `collide`, because a contact
    of MuJoCo takes several time steps; the last of the errors says how far that is from `strike`.

    Along the normal MuJoCo's contact is a spring and a damper per unit of mass that do not pull.
    Of damping ratio :math:`\zeta` and frequency :math:`\omega`, with
    :math:`s = \sqrt{1 - \zeta^2}`, it ends at the phase
    :math:`\varphi = \mathrm{atan2}(2 \zeta s, 2 \zeta^2 - 1)`, and

    .. math:: e = \exp(-\zeta \varphi / s), \qquad T = \varphi / (s\, \omega),

    for masses of any size. With a step h, Euler's method has that frequency and decay for the
    damping :math:`b = (1 - e^{-2 \zeta \omega h}) / h` and the stiffness
    :math:`k = (2 - b h - 2 e^{-\zeta \omega h} \cos(s\, \omega h)) / h^2`. From there k and b, and
    with friction its coefficient and damping, are fitted by least squares to simulated kicks that
    reach the ball at several moments within a time step; of several growths of the impedance, the
    one with the smallest errors is taken.

    The leg is simulated without motors, its foot as a plane, as in `collide`. The parameters are
    fitted to the ball alone: impulses in the joints can differ much more.

    Args:
        posture: posture of a leg without supports, loops, mimic and stiff joints.
        v: joint velocity just before, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: the ball; its centre is at `contact point + radius * normal`.
        contact: normal, friction of at most 10, and a restitution of at least 0.2 at this speed of
            approach, which is at least 0.01 m/s.
        timestep: time step of the simulation [s], at most 0.02 and half of `contact_time`, at least
            a 500th of it.
        integrator: integrator of MuJoCo: `Euler`, `implicit`, `implicitfast` or `RK4`.
        contact_time: contact time [s], as for `collide`, 1e-5 to 0.1; 10 ms by default.
        tolerance: error of the ball's speed that is accepted, relative, 0.001 to 1; twice as much
            at 0.5 to 1.5 times all velocities. For the direction, 1 degree is accepted.
        ball_velocity: velocity of its centre just before, shape `(3,)` [m/s, world frame].
        ball_spin: angular velocity just before, shape `(3,)` [rad/s, world frame].

    Raises:
        NoImpact: foot and ball do not approach each other along the normal.
        KickdynError: no simulated kick ends.
    """
    load_mujoco()
    step = validation.number("timestep", timestep, above=0, at_most=LONGEST_STEP, unit="s")
    chosen = validation.choice("integrator", integrator, MujocoIntegrator)
    validation.number("tolerance", tolerance, at_least=1e-3, at_most=1)
    validation.number("friction", contact.friction, at_least=0, at_most=10)
    duration = validation.number(
        "contact time", contact_time, at_least=1e-5, at_most=LONGEST_CONTACT, unit="s"
    )
    if not duration / MOST_STEPS <= step <= duration / 2:
        raise InvalidInput(
            f"timestep is {step:g} s: a contact of {duration:g} s must take 2 to {MOST_STEPS} "
            f"steps, so valid time steps are {duration / MOST_STEPS:g} to {duration / 2:g} s"
        )
    approach = find_approach(posture, v, ball, contact, ball_velocity, ball_spin)
    validation.number("approach speed", approach.speed, at_least=LEAST_SPEED, unit="m/s")
    validation.number("restitution", approach.restitution, at_least=LEAST_RESTITUTION)
    scene(approach, step, MujocoContact())  # refuses a leg before the work
    cases = kick_cases(approach, duration)
    fitted = find_best(cases, step, chosen, duration, tolerance)
    moving: Any = {"ball_velocity": ball_velocity, "ball_spin": ball_spin}
    instant = strike(posture, v, ball, contact, **moving).ball_after
    against_strike = cases[0]._replace(change="against kd.strike", target=instant)
    best = fitted.contact
    return MujocoTuning(
        **best._asdict(),
        timestep=step,
        integrator=chosen.value,
        contact_time=fitted.contact_time,
        wanted_contact_time=duration,
        errors=(*fitted.errors, find_error(against_strike, fitted.kick, best)),
        tolerance=tolerance,
        scene=scene(approach, step, best, chosen.value, gravity=True),
        ball=ball,
        ball_position=approach.ball_before.position,
    )


def digits(values: Iterable[float]) -> str:
    """Return parameters as text, without the zeros after a decimal point."""
    return " ".join(f"{value:.6g}" for value in values)
