"""What a swing costs: the hardest kick with and without one, and processor time to find it.

    python benchmarks/swing.py [human testbed g1]

Each leg gets a goal beyond it, which leaves the hardest kick in that direction, and one that it
meets. Times are those of this process, also over that of the plan without a swing.
"""

from __future__ import annotations

import sys
import time
from itertools import pairwise

import kickdyn as kd

LEGS = {
    "human": (kd.Leg.human, kd.Goal(100, time=3), kd.Goal(20, time=1.2)),
    "testbed": (kd.Leg.testbed, kd.Goal(20, time=1.5), kd.Goal(1.5, time=0.6)),
    "g1": (lambda: kd.Leg.from_robot("g1"), kd.Goal(60, time=2), kd.Goal((4, 1, 0), time=0.8)),
}
BALL, AIR = kd.Ball(), kd.Air()


def main() -> None:
    """Print a line for each leg."""
    for name in sys.argv[1:] or LEGS:
        make, beyond, easy = LEGS[name]
        leg = make()
        hardest = [kd.plan_kick(leg, beyond, BALL, AIR, swing=swing) for swing in (False, True)]
        speeds = [float(plan.impact.ball_after.speed) for plan in hardest]
        marks = [time.process_time()]
        for swing in (False, True):
            plan = kd.plan_kick(leg, easy, BALL, AIR, swing=swing)
            marks.append(time.process_time())
        found = {}
        for objective in ("torque-squared", "time"):
            found[objective] = kd.plan_swing(leg, plan, objective=objective)
            marks.append(time.process_time())
        spent = [after - before for before, after in pairwise(marks)]
        print(
            f"{name}: hardest ball {speeds[0]:.1f} m/s, with a swing {speeds[1]:.1f} m/s; plan "
            f"{spent[0]:.1f} s, with a swing {spent[1]:.1f} s ({spent[1] / spent[0]:.1f} times); "
            f"its swing of least torque {spent[2]:.1f} s, of least time {spent[3]:.1f} s; "
            f"{found['torque-squared'].status}, {found['time'].status}"
        )


if __name__ == "__main__":
    main()
