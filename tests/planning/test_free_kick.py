from functools import partial

import pytest

import kickdyn as kd
from kickdyn.planning.free_kick import MISSES, Wall, score, scored

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
CORNER = kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), over=(9.15, 2.0)), BALL, AIR)
FLAT = kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), time=0.7), BALL, AIR, limits=False)


def kick(leg=LEG, limits=True, **options):
    return partial(kd.plan_kick, leg, ball=BALL, air=AIR, limits=limits, **options)


def test_a_wall_is_cleared_by_what_the_goal_asked_for():
    assert Wall(9.15, 1.9).passed(CORNER, kick()) == "Its lower edge clears the wall by 0.1 m."


def test_a_wall_that_is_hit_says_what_clears_it():
    wall = Wall.read("9.15:1.9")
    with pytest.raises(kd.InvalidInput, match="hits the wall") as said:
        wall.passed(FLAT, kick(limits=False))
    # a planar leg gives no side spin: over is the only way, and it is one
    assert str(said.value).endswith("its edge: go over it (--over 9.15:2 in place of --time)")
    over = kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), over=(9.15, 2.0)), BALL, AIR, limits=False)
    assert "clears the wall" in wall.passed(over, kick())


def test_a_leg_that_can_give_side_spin_may_go_beside_a_wall():
    leg = kd.Leg.from_robot("g1", legs_only=True)
    flat = kd.plan_kick(leg, kd.Goal((20, 0, 1), time=1.0), BALL, AIR, limits=False)
    wall = Wall(9.15, 5.0, 0.4)
    with pytest.raises(kd.InvalidInput, match=r" or beside it \(--beside 9.15:0.41\)$"):
        wall.passed(flat, kick(leg, limits=False))


def test_where_nothing_clears_a_wall_no_way_is_named():
    flat = kd.plan_kick(LEG, kd.Goal(30, time=1.5), BALL, AIR)
    with pytest.raises(kd.InvalidInput, match="leg_human has no kick over or beside it either"):
        Wall(9.15, 60.0).passed(flat, kick())
    rolled = kd.plan_kick(LEG, kd.Goal(8, time=2), BALL, AIR, surface="carpet")
    with pytest.raises(kd.InvalidInput, match="along the ground there is no way round it"):
        Wall(4, 1).passed(rolled, kick(surface="carpet"))


def test_a_kick_too_weak_says_where_it_ends():
    weak = kd.plan_kick(LEG, kd.Goal((40, 0, 2.1), time=1.2), BALL, AIR)
    assert weak.status == "beyond-limits"
    with pytest.raises(
        kd.InvalidInput, match="beyond the leg's limits, and the ball hits the wall"
    ):
        Wall(9.15, 2.5).passed(weak, kick())
    assert Wall(39.0, 1.9).passed(weak, kick()) == "The ball comes down before the wall."


def test_a_narrow_wall_off_a_curved_way_is_passed_beside():
    leg = kd.Leg.from_robot("g1", legs_only=True)
    goal = kd.Goal((20, 0, 1), time=1.0, beside=(9.15, 0.6))
    plan = kd.plan_kick(leg, goal, BALL, AIR, limits=False)
    assert plan.landing_error < 1e-3
    assert (
        Wall(9.15, 5.0, 0.4).passed(plan, kick())
        == f"It passes {0.4 - BALL.radius:.3g} m left of the wall."
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("9.15", "it must be DISTANCE:HEIGHT"),
        ("a:b", "it must be numbers"),
        ("9.15:-1", "height of the wall is -1"),
        ("nan:1", "distance of the wall is nan"),
        ("30:1.9", "between the ball and the target"),
    ],
)
def test_bad_walls(text, words):
    with pytest.raises(kd.InvalidInput, match=words):
        Wall.read(text).passed(CORNER, kick())


def missing(target):
    """Return how a kick to a target beside the goal ends, and that it is said."""
    plan = kd.plan_kick(LEG, kd.Goal(target, time=1.0), BALL, AIR, limits=False)
    found = score(plan)
    assert scored(plan) == f"It {MISSES[found.end]}."
    return found


def test_the_goal():
    post, bar = 3.66 - 3.4 - BALL.radius, 2.44 - 2.1 - 2 * BALL.radius
    assert (
        scored(CORNER) == f"It goes in, {post:.3g} m from the post and {bar:.3g} m under the bar."
    )
    wide = {"post": 3.77 + BALL.radius, "beside": 3.79 + BALL.radius}  # a post is 0.12 m wide
    high = {"bar": 2.55, "over": 2.57}  # of the ball's lower edge
    for end, left in wide.items():
        assert missing((20, left, 1)).end == missing((20, -left, 1)).end == end
    for end, up in high.items():
        assert missing((20, 0, up)).end == end
    assert missing((20, 3.67 - BALL.radius, 1)).end == "post"
    assert missing((20, 0, 2.45 - 2 * BALL.radius)).end == "bar"
    assert missing((20, wide["beside"], high["bar"])).end == "beside"
    assert missing((20, wide["post"], high["over"])).end == "over"
    weak = kd.plan_kick(LEG, kd.Goal(100, time=3), BALL, AIR)
    assert scored(weak) == "It does not come to the goal."
