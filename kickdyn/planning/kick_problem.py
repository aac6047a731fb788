r"""The problem of a kick: its terms, postures to start from, and its solution.

.. math::
    \min_{q, v, s} f(q, v) \quad\text{subject to the terms of the foot, the joints and the stance.}

A limit that every kick must keep is a term in the list of `kick_problem`. A problem is solved from
those postures that need the least joint speed, of many that are drawn with a fixed seed.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import pinocchio as pin

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.planning.kick_limits import (
    Balance,
    BodyClearance,
    JointRange,
    KickClearance,
    KickMuscleTorqueLimit,
    KickSpeedLimit,
    KickTorqueLimit,
    SupportImpulse,
    Upright,
    bodies_near_ball,
    check_limits,
)
from kickdyn.planning.kick_terms import (
    BallPosition,
    Facing,
    KickPoint,
    KickVariables,
    LargestShare,
    Objective,
    StrikeVelocity,
    place_exactly,
    turn_to_ball,
)
from kickdyn.planning.problem import TOLERANCE, Function, Kind, Problem, Term
from kickdyn.robot.collisions import CollisionBody, bodies_at, find_self_collisions
from kickdyn.robot.ground_clearance import TOLERANCE as ON_GROUND
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import (
    KickingChain,
    StandingRobot,
    foot_directions,
    is_floating,
    kicking_chain,
    vertical_plane,
)
from kickdyn.robot.surgery import place_body

DRAWN, STARTS, RATED, WIDELY_DRAWN = 80, 4, 20, 80
"""Numbers of postures that are drawn, of those among them from which a problem is solved, of those
by which several problems are compared, and of those from the whole ranges of the joints."""

STRONGEST_DRAWN, STRONGEST_RATED, SPREAD = 400, 32, 8
"""Numbers of postures that are drawn from the whole ranges of the joints to seek the strongest
kick, of those with the best rating among them, and of others of any rating. Postures that need the
least joint speed for the whole launch may all lead to a local optimum that is a fifth too weak."""

AT_BALL = 1e-6
"""Distance between a foot and a ball that touch, at most [m]."""

FARTHEST_START, FARTHEST_STANDING_START = 1.0, 0.5
"""Largest angle of a joint in a drawn posture, on a fixed base and on one foot [rad]: farther, a
leg is bent more than in any kick, and the trunk of a standing robot lies down."""

MUSCLES = "muscles"
"""Value of `limits` with which torque limits fall with speed."""

MOST_PAIRS = 8
"""Number of pairs of bodies from which on no more are kept apart."""

AnyTerm = TypeVar("AnyTerm", bound=Term[KickPoint])


@dataclass(frozen=True, eq=False)
class KickProblem:
    """The problem of a kick."""

    # that kicks; turned by `heading` [rad] to the left about the vertical, then moved by `moved`
    robot: Leg
    # the kicking limb of the robot with all that branches off it, on a fixed base
    limb: KickingChain
    variables: KickVariables  # the unknowns
    foot_directions: Array  # in which the foot can move at all, orthonormal rows, shape `(k, 3)`
    terms: tuple[Term[KickPoint], ...]  # the conditions and bounds, without an objective
    drawn: Array  # postures that are drawn, shape `(m, n)` [rad; m for prismatic joints]
    heading: float  # see `robot`
    moved: Array  # see `robot`, shape `(3,)` [m]
    standing: StandingRobot | None = None  # the robot on its foot; None for a leg on a fixed base
    pairs: Sequence[
        tuple[CollisionBody, None]
    ] = ()  # bodies that can come near the ball, each with it

    def on_robot(self, point: KickPoint) -> tuple[Array, Array]:
        """Return q and v of the robot at a point, shapes `(nq,)` and `(nv,)`."""
        q, v = point.posture.q, point.v
        if self.standing is None:
            return self.limb.robot_state(self.robot, q, v)
        return self.standing.robot_state(*self.limb.robot_state(self.standing.leg, q, v))

    def find(self, kind: type[AnyTerm]) -> AnyTerm | None:
        """Return the term of a class; None if the problem has none."""
        return next((term for term in self.terms if isinstance(term, kind)), None)

    def without(self, terms: Iterable[Term[KickPoint]]) -> "KickProblem":
        """Return the problem without some of its terms."""
        omitted = list(terms)
        return replace(self, terms=tuple(term for term in self.terms if term not in omitted))

    def variants(self) -> "Iterator[KickProblem]":
        """Yield the problem, then those without the last terms that are not required."""
        yield self
        optional = [term for term in self.terms if not term.required]
        for count in reversed(range(len(optional))):
            yield self.without(optional[count:])

    def solve(self, objective: Function[KickPoint], starts: Sequence[Array]) -> list[KickPoint]:
        """Return the solutions from each start, with exact foot velocities.

        They reach the whole foot velocity, or as much as possible if that is the objective.
        """
        problem, variables = self._with(objective), self.variables
        strike = self.find(StrikeVelocity)
        assert strike is not None
        solutions = [problem.solve(start) for start in starts]
        return [strike.make_exact(variables.point(x)) for x in solutions if x is not None]

    def polish(self, objective: Function[KickPoint], point: KickPoint) -> KickPoint:
        """Return a solution in all digits, see `Problem.polish`."""
        return self.variables.point(self._with(objective).polish(point.x))

    def _with(self, objective: Function[KickPoint]) -> Problem[KickPoint]:
        terms = self.terms
        if not isinstance(objective, LargestShare):
            terms += (JointRange(self.variables, least_share=1.0),)
        return Problem(self.variables.size, self.variables.point, (objective, *terms))

    def starts(self) -> list[Array]:
        """Return the unknowns of the drawn postures that need the least joint speed."""
        return [x for _, _, x in self.rated()[:STARTS]]

    def at_ball(self, count: int) -> "KickProblem":
        """Return the problem with the best postures in which the foot touches the ball, if any.

        Drawn postures, also from the whole ranges of the joints, are moved to the ball, with the
        side of the foot that may meet it turned to it.
        """
        ball, facing, variables = self.find(BallPosition), self.find(Facing), self.variables
        assert ball is not None
        placed = []
        for q in (*self.drawn, *self.widely_drawn(WIDELY_DRAWN)):
            start = variables.point(np.array([*q, *np.zeros(variables.n), 1.0]))
            point = place_exactly(ball, start)
            if _touches(ball, point):
                rotated = point if facing is None else turn_to_ball(ball, facing, point)
                placed.append((rotated if _touches(ball, rotated) else point).x[: variables.n])
        touching = replace(self, drawn=np.reshape(placed, (-1, variables.n)))
        rated = [x[: variables.n] for _, _, x in touching.rated()]
        best = [q for q in rated if self.may_meet(q)] or rated
        return replace(self, drawn=np.reshape(best[:count], (-1, variables.n)))

    def widely_drawn(self, count: int) -> Array:
        """Return postures that are drawn from the whole ranges of the joints, `(count, n)`."""
        variables, draw = self.variables, np.random.default_rng(1)
        return draw.uniform(variables.lower, variables.upper, (count, variables.n))

    def strong_starts(self) -> list[Array]:
        """Return the unknowns from which the strongest kick is sought."""
        rated = [x for _, _, x in self.rated()]
        starts = rated[:: max(len(rated) // SPREAD, 1)]
        if self.standing is None:  # of others, the trunk lies down
            wide = replace(self, drawn=self.widely_drawn(STRONGEST_DRAWN))
            rated = [x for _, _, x in wide.rated()]
            starts += rated[:STRONGEST_RATED] + rated[STRONGEST_RATED :: STRONGEST_DRAWN // SPREAD]
        return starts

    def may_meet(self, q: Array) -> bool:
        """Return whether the side of the foot at the ball may meet it, at q of shape `(n,)`."""
        facing, posture = self.find(Facing), self.variables.posture(q)
        return facing is None or bool((facing.residual(posture, posture.q) > 0.0).all())

    @property
    def rating(self) -> float:
        """Least rating of some of the drawn postures, see `rated`."""
        return replace(self, drawn=self.drawn[:RATED]).rated()[0][0]

    def rated(self) -> list[tuple[float, int, Array]]:
        """Return drawn postures with rating, number and unknowns, the best one first.

        The rating is the largest speed over its limit, plus what the posture violates over its
        scale: the length of the violation of equalities, and the sum over inequalities.
        """
        variables, scale, rated = self.variables, self.variables.velocity_scale, []
        rating = [f for f in self.terms if isinstance(f, Function) and f.rates_starts]
        for number, q in enumerate(self.drawn):
            posture = variables.posture(q)
            rows = posture.jacobian[:, variables.vs] * scale
            needed = variables.target.foot_velocity(posture) - posture.transport_velocity
            v = np.linalg.pinv(rows, rcond=1e-2) @ needed
            point = variables.point(np.array([*q, *v, 1.0]))
            total = float(np.abs(v).max())
            for term in rating:
                value = term.value(point) / term.scale
                is_equal = term.kind == Kind.EQUALITY
                total += float(np.linalg.norm(value) if is_equal else -np.minimum(value, 0.0).sum())
            rated.append((total, number, point.x))
        return sorted(rated)


def kick_problem(
    robot: Leg,
    target: ImpactTarget,
    ball_position: float | Array | None = None,
    *,
    limits: bool | str = True,
    like: KickProblem | None = None,
) -> KickProblem:
    """Return the problem of a kick by a leg on a fixed base, or a robot that stands on one foot.

    Args:
        robot: that kicks.
        target: the impact.
        ball_position: height or position of the ball's centre, shape `(3,)` [m, world frame]; None
            leaves it free.
        limits: whether limits of speed and torque hold; `MUSCLES` for torques that fall with speed.
        like: a problem of the same robot, whose parts are used again.

    Raises:
        InvalidInput: a leg that cannot kick in this direction, or with this spin.
    """
    draw = np.random.default_rng(0)
    if like is not None and like.standing is None:
        variables = like.variables.for_target(target)
        heading, way = _placement(variables, like.foot_directions, ball_position)
        if like.heading or like.moved.any() or heading or way.any():
            like = None  # the leg of `like` is not where this kick needs it
    like = like or _without_terms(robot, target, ball_position, draw)
    robot, directions, standing = like.robot, like.foot_directions, like.standing
    variables = like.variables.for_target(target)
    _check_directions(variables, directions)

    # the later, the less a kick needs it: an explanation omits the last terms first
    terms: list[Term[KickPoint]] = [JointRange(variables), StrikeVelocity(variables, directions)]
    if ball_position is not None:
        terms.append(_place_ball(variables, directions, ball_position, draw))
    if limits:
        check_limits(variables)
        torque = KickMuscleTorqueLimit if limits == MUSCLES else KickTorqueLimit
        terms += [KickSpeedLimit(variables), torque(variables)]
    cone = variables.leg.contact_normal_cone
    if cone is not None and target.contact.offset is None:  # at another point, it is unknown
        terms.append(Facing(variables, cone))
    if standing is not None:
        terms += [Balance(standing), KickClearance(standing.robot, standing.leg), Upright(standing)]
        terms.append(SupportImpulse(standing, target.impulse))
    if like.pairs:
        terms.append(BodyClearance(robot, variables, like.pairs))

    drawn = like.drawn
    if not len(drawn):
        farthest = FARTHEST_START if standing is None else FARTHEST_STANDING_START
        lower = np.minimum(np.maximum(variables.lower, -farthest), variables.upper)
        upper = np.maximum(np.minimum(variables.upper, farthest), variables.lower)
        drawn = draw.uniform(lower, upper, (DRAWN, variables.n))
    return replace(like, variables=variables, terms=tuple(terms), drawn=drawn)


def _without_terms(
    robot: Leg,
    target: ImpactTarget,
    ball_position: float | Array | None,
    draw: np.random.Generator,
) -> KickProblem:
    """Return a problem without terms and drawn postures, of a leg that is placed at the ball."""
    standing = StandingRobot(robot) if is_floating(robot) else None
    if standing is not None:
        robot = standing.robot
        limb = kicking_chain(standing.leg, branches=True)
    else:
        if robot.supports or robot.loops:
            raise InvalidInput(
                f"{robot.name} has supports or loops, which tie joints together: kicks from a "
                "fixed base are planned for legs without supports and loops only"
            )
        limb = kicking_chain(robot, branches=True)
    variables = KickVariables(limb.leg, target)
    directions = _foot_directions(variables, draw)
    heading, moved = 0.0, np.zeros(3)
    if standing is None:
        heading, moved = _placement(variables, directions, ball_position)
    validation.protect(moved)
    if heading or moved.any():
        place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, heading), moved)
        robot = robot.with_model(place_body(robot.model, 0, place))
        limb = kicking_chain(robot, branches=True)
        variables = KickVariables(limb.leg, target)
        directions = _foot_directions(variables, draw)
    pairs = bodies_near_ball(robot)
    drawn = np.zeros((0, variables.n))
    return KickProblem(
        robot, limb, variables, directions, (), drawn, heading, moved, standing, pairs
    )


def solve_kick(problem: KickProblem, objective: Objective) -> tuple[KickProblem, KickPoint]:
    """Return the best solution of a problem; where none meets the goal, the strongest kick.

    Before it comes the problem, without optional terms that no point keeps, and with a term that
    keeps bodies apart which are otherwise inside each other.

    Raises:
        InvalidInput: no posture keeps the terms, with the reason.
    """
    solved, pairs = problem, set[tuple[str, str]]()
    while True:
        solved, point = _solve(solved, objective)
        collisions = find_self_collisions(problem.robot, problem.on_robot(point)[0]).keys() - pairs
        if not collisions or len(pairs) > MOST_PAIRS:
            return solved, point
        pairs |= collisions
        solved = keep_apart(problem, pairs)


def keep_apart(problem: KickProblem, pairs: Iterable[tuple[str, str]]) -> KickProblem:
    """Return the problem with a term that keeps bodies apart, which are named in pairs."""
    bodies = [
        (body, other)
        for first, second in sorted(pairs)
        for body in bodies_at(problem.robot, first)
        for other in bodies_at(problem.robot, second)
    ]
    apart = BodyClearance(problem.robot, problem.variables, bodies)
    return replace(problem, terms=(*problem.terms, apart))


def keep_above(problem: KickProblem, ground: float) -> KickProblem:
    """Return the problem with a term that keeps the kicking foot above a ground [m]."""
    above = KickClearance(problem.robot, problem.variables.leg, ground - ON_GROUND)
    return replace(problem, terms=(*problem.terms, above))


def _solve(problem: KickProblem, objective: Objective) -> tuple[KickProblem, KickPoint]:
    """Return the best solution of a problem as it is."""
    for variant in problem.variants():
        starts = variant.starts()
        best = best_from(variant, objective, starts)
        if best is not None:
            return variant, best
    if points := variant.solve(LargestShare(), variant.strong_starts()):
        strongest = max(points, key=lambda point: point.share)
        if strongest.share >= 1.0 - 1e-6:
            full = variant.variables.point(np.append(strongest.x[:-1], 1.0))
            strongest = next(iter(variant.solve(objective, [strongest.x])), full)
        return variant, strongest
    ball = problem.find(BallPosition)
    place = "" if ball is None else f" {ball.place}"
    raise InvalidInput(
        f"{problem.robot.name} has no posture in which it can give a ball{place} the required "
        f"launch; {explain_infeasible(problem)}"
    )


def best_from(problem: KickProblem, objective: Objective, starts: list[Array]) -> KickPoint | None:
    """Return the best of the solutions from some starts; None if none meets the goal."""
    points = problem.solve(objective, starts)
    return min(points, key=lambda point: float(objective.value(point)[0])) if points else None


def explain_infeasible(problem: KickProblem) -> str:
    """Return why a problem has no solution: the last terms without which it has one."""
    *_, problem = problem.variants()
    for explanation in dict.fromkeys(term.explanation for term in reversed(problem.terms)):
        omitted = [term for term in problem.terms if term.explanation == explanation]
        if explanation and _is_feasible(problem.without(omitted)):
            return explanation
    if _is_feasible(problem.without(term for term in problem.terms if term.explanation)):
        return "it has one only without two or more of its conditions"
    return "the ranges of its joints allow none"


def _is_feasible(problem: KickProblem) -> bool:
    return bool(problem.solve(LargestShare(), problem.starts()))


def _touches(ball: BallPosition, point: KickPoint) -> bool:
    return float(np.abs(ball.residual(point.posture, point.v)).max()) < AT_BALL


def _foot_directions(variables: KickVariables, draw: np.random.Generator) -> Array:
    """Return the directions in which the foot can move at all, orthonormal rows, by drawn q."""
    drawn = draw.uniform(variables.lower, variables.upper, (8, variables.n))
    return foot_directions(variables.posture(q) for q in drawn)


def _leaves(directions: Array, vector: Array, size: float | None = None) -> bool:
    """Return whether a vector has a part, over its size, across all directions."""
    residual = vector - directions.T @ (directions @ vector)
    size = float(np.linalg.norm(vector)) if size is None else size
    return bool(np.linalg.norm(residual) > 1e-6 * size)


def _check_directions(variables: KickVariables, directions: Array) -> None:
    """Refuse an impulse that a foot which moves in a plane cannot give, or that lets it slide."""
    if len(directions) == 3:  # nothing is across
        return
    target, name = variables.target, variables.leg.name
    if _leaves(directions, target.contact.normal):
        change = (target.impulse / target.ball.mass).round(4).tolist()
        raise InvalidInput(
            f"{name} cannot give this launch: its foot moves in a plane, and the change of the "
            f"ball's velocity by {change} m/s is not in it"
        )
    if target.contact.friction == 0.0:
        return
    drawn = np.linspace(variables.lower, variables.upper, 3)
    bases = [variables.posture(q).transport_velocity for q in drawn]
    ball, change = target.surface_velocity, target.surface_change
    speed = max(float(np.linalg.norm(velocity)) for velocity in (ball, change, *bases))
    if any(_leaves(directions, ball + change - base, speed) for base in bases):
        cause = "its base moves across this plane" if any(map(np.any, bases)) else (
            "the kick has to give the ball side spin, or to take it away"
        )  # fmt: skip
        raise InvalidInput(
            f"{name} cannot give this launch and spin: its foot moves in a plane, and {cause}; "
            'a foot that moves sideways can (g1, Leg.human(..., model="3d")); a contact without '
            "friction (friction=0, --friction 0) has no such limit, and leaves the spin as it is"
        )


def _place_ball(
    variables: KickVariables, directions: Array, position: float | Array, draw: np.random.Generator
) -> BallPosition:
    if isinstance(position, float | int):
        return BallPosition(variables, np.array([0.0, 0.0, position]), np.array([[0.0, 0.0, 1.0]]))
    q = draw.uniform(variables.lower, variables.upper)
    offset = variables.point(np.append(q, np.zeros(variables.n + 1))).ball_centre - position
    beside = float(np.linalg.norm(offset - directions.T @ (directions @ offset)))
    if beside > TOLERANCE * variables.target.ball.radius:
        raise InvalidInput(
            f"the ball at {position.tolist()} m is {beside:.4g} m from the plane in which the foot "
            f"of {variables.leg.name} moves"
        )
    return BallPosition(variables, position, directions)


def _placement(
    variables: KickVariables, directions: Array, position: float | Array | None
) -> tuple[float, Array]:
    """Return the turn [rad] and the way [m] that bring the plane of a foot to impulse and ball.

    The way is across the plane. Both are 0 of a foot that moves in no vertical plane.
    """
    target, normal = variables.target, vertical_plane(directions)
    vector, heading, way = target.facing, 0.0, np.zeros(3)
    level, leaves = math.hypot(vector[0], vector[1]), _leaves(directions, vector)
    if normal is None:
        return heading, way
    ahead = np.array([normal[1], -normal[0]])
    behind = not float(ahead @ vector[:2]) > 0.0
    if (leaves and level > 0.0) or (behind and level > 1e-6 * np.linalg.norm(vector)):
        turn = math.atan2(vector[1], vector[0]) - math.atan2(ahead[1], ahead[0])
        heading = math.remainder(turn, 2 * math.pi)
    if isinstance(position, np.ndarray) and position.shape == (3,):
        turned = pin.rpy.rpyToMatrix(0.0, 0.0, heading)
        foot = turned @ variables.posture(np.zeros(variables.n)).contact_point
        across, gap = turned @ normal, position - target.ball.radius * target.contact.normal - foot
        if abs(float(across @ gap)) > AT_BALL:
            way = (across @ gap) * across + 0.0  # no -0
    return heading, way
