"""A free kick over a wall into a goal 20 m away: plan it, check it, and look at it."""

import kickdyn as kd
from kickdyn.view.wall_and_goal import goal_boxes, wall_boxes

DISTANCE, WALL, HEIGHT = 20.0, 9.15, 1.9  # of the goal, of the wall, height of the wall [m]
BACK_SPIN = (0, -20, 0)  # [rad/s]

leg, ball, air = kd.Leg.human(), kd.Ball(), kd.Air()

# The ball lies on the ground. Its centre passes 0.4 m above the wall, and the goal line 1 m high.
goal = kd.Goal(
    (DISTANCE, 0, 1 - ball.radius), over=(WALL, HEIGHT + 0.4 - ball.radius), spin=BACK_SPIN
)
plan = kd.plan_kick(leg, goal, ball, air)
print(plan)

ground = plan.path.launch.position - (0, 0, ball.radius)
at_wall = plan.path.arrival(ground[0] + WALL)
clearance = at_wall.position[2] - ball.radius - (ground[2] + HEIGHT)
print(f"The ball clears the wall by {clearance:.2f} m at {at_wall.speed:.1f} m/s.")

wall = wall_boxes(ground, goal.ahead, WALL, HEIGHT, width=2.5)
kd.page(plan, scenery=[*wall, *goal_boxes(ground, DISTANCE)]).save("free_kick.html")
