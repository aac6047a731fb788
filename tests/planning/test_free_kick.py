import pytest

import kickdyn as kd
from kickdyn.planning.free_kick import ENDS, Wall, score

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
CORNER = kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), over=(9.15, 2.0)), BALL, AIR)
FLAT = kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), time=0.7), BALL, AIR, limits=False)


def test_a_wall_is_cleared_by_what_the_goal_asked_for():
    said = Wall(9.15, 1.9).describe_passage(CORNER)
    assert said == "Its lower edge clears the wall by 0.1 m."


def test_a_wall_that_is_hit_says_which_options_clear_it():
    wall = Wall.read("9.15:1.9")
    over = "ask for --over 9.15:2 in place of --time, or for --beside 9.15:1.46"
    with pytest.raises(kd.InvalidInput, match=f"hits the wall, .* its edge: {over}$"):
        wall.describe_passage(FLAT)
    high = kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), over=(9.15, 2.0)), BALL, AIR, limits=False)
    assert "clears the wall" in wall.describe_passage(high)
    leg, narrow = kd.Leg.from_robot("g1", legs_only=True), Wall(9.15, 5.0, 0.4)
    flat = kd.plan_kick(leg, kd.Goal((20, 0, 1), time=1.0), BALL, AIR, limits=False)
    with pytest.raises(kd.InvalidInput, match=r" --beside 9.15:0.41$"):
        narrow.describe_passage(flat)
    bent = kd.Goal((20, 0, 1), time=1.0, beside=(9.15, 0.411))
    curved = kd.plan_kick(leg, bent, BALL, AIR, limits=False)
    assert "left of the wall" in narrow.describe_passage(curved)


def test_along_the_ground_no_option_clears_a_wall():
    rolled = kd.plan_kick(LEG, kd.Goal(8, time=2), BALL, AIR, surface="carpet")
    with pytest.raises(kd.InvalidInput, match=r"inside its edge$"):
        Wall(4, 1).describe_passage(rolled)


def test_a_kick_too_weak_says_where_it_ends():
    weak = kd.plan_kick(LEG, kd.Goal((40, 0, 2.1), time=1.2), BALL, AIR)
    assert weak.status == "beyond-limits"
    with pytest.raises(
        kd.InvalidInput, match="beyond the leg's limits, and the ball hits the wall"
    ):
        Wall(9.15, 2.5).describe_passage(weak)
    assert Wall(39.0, 1.9).describe_passage(weak) == "The ball comes down before the wall."


def test_a_narrow_wall_off_a_curved_way_is_passed_beside():
    leg = kd.Leg.from_robot("g1", legs_only=True)
    goal = kd.Goal((20, 0, 1), time=1.0, beside=(9.15, 0.6))
    plan = kd.plan_kick(leg, goal, BALL, AIR, limits=False)
    assert plan.landing_error < 1e-3
    assert (
        Wall(9.15, 5.0, 0.4).describe_passage(plan)
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
        Wall.read(text).describe_passage(CORNER)


def missing(target):
    """Return how a kick to a target beside the goal ends, and that it is said."""
    plan = kd.plan_kick(LEG, kd.Goal(target, time=1.0), BALL, AIR, limits=False)
    found = score(plan)
    assert str(found) == f"It {ENDS[found.end]}."
    return found


def test_the_goal():
    post, bar = 3.66 - 3.4 - BALL.radius, 2.44 - 2.1 - 2 * BALL.radius
    assert (
        str(score(CORNER))
        == f"It goes in, {post:.3g} m from the post and {bar:.3g} m under the bar."
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
    assert str(score(weak)) == "It does not come to the goal."
