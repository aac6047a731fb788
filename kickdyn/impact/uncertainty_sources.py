"""What a strike depends on: the sources of uncertainty, their sizes and units."""

from __future__ import annotations

from collections.abc import Iterable

from kickdyn.robot.leg import Leg

UNITS = {
    "q": "rad",
    "v": "rad/s",
    "restitution": "1",
    "friction": "1",
    "normal": "rad",
    "ball_mass": "kg",
    "ball_radius": "m",
    "ball_velocity": "m/s",
    "ball_spin": "rad/s",
    "link_mass": "kg",
    "link_inertia": "",
}
"""Every source and its unit; of prismatic joints, q is in m and v in m/s.

Of a leg that supports or loops hold, v and q count as far as they let: v without what would move
them, by kinetic energy, also where q changes it; q without what would open a loop (the least change
of angles is taken off), whereas supports hold wherever q puts them.
`normal` is the direction of the contact normal as a unit vector: what is along it has no effect.
`ball_mass` takes the ball's inertia along. `link_mass` scales a link as a whole: centre of mass
and radii of gyration stay; massless links do not count. `link_inertia`
holds ten numbers per link as Pinocchio orders them: mass [kg], mass times centre of mass [kg m],
and xx, xy, yy, xz, yz, zz of the inertia about the joint's origin [kg m2], in the joint's axes.
Links count as `leg.joint_names`, all else in the world frame.
"""

LINK_INERTIA = {"mass": ("kg", (0,)), "mass times centre": ("kg m", (1, 2, 3)),
                "moments": ("kg m2", tuple(range(4, 10)))}  # fmt: skip
"""Which of a link's ten numbers have which unit."""

OF_LEG = ("q", "v", "link_mass", "link_inertia")
"""Sources that change the leg; all others leave it as it is, and cost a fraction."""


def columns(leg: Leg, names: Iterable[str] = UNITS) -> dict[str, slice]:
    """Return where each source stands when all, or those named, are written side by side."""
    links = len(leg.joint_names)
    sizes = {"q": leg.nv, "v": leg.nv, "normal": 3, "ball_velocity": 3, "ball_spin": 3}
    sizes |= {"link_mass": links, "link_inertia": 10 * links}
    places, start = {}, 0
    for name in names:
        stop = start + sizes.get(name, 1)
        places[name] = slice(start, stop)
        start = stop
    return places
