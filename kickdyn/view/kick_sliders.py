"""Sliders in Jupyter that move a kick in a live view."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.robot.leg import Leg
from kickdyn.view.show import View, show

START = {"hip": 10.0, "knee": 20.0, "ankle": -5.0}
"""Angles of the leg of a person at first [deg]; other joints are at 0."""

MOST_SLIDERS = 8
"""Most joints that get a slider."""

RANGES = {
    "foot speed": (10.0, 1.0, 20.0, 0.5, " [m/s]"),
    "foot direction": (20.0, -30.0, 80.0, 1.0, " [°]"),
    "normal": (25.0, -30.0, 80.0, 1.0, " [°]"),
    "restitution": (0.8, 0.0, 1.0, 0.01, ""),
    "friction": (0.4, 0.0, 1.0, 0.01, ""),
    "spin": (0.0, -60.0, 60.0, 1.0, " [rad/s]"),
}
"""Value at first, least and largest value, step and unit of sliders; joints are in degrees."""


class KickSliders:
    """Sliders for posture, foot speed, direction, restitution, friction and spin, and the view.

    Each movement of a slider computes impact and flight and moves the parts of the live view: leg,
    ball, impulse ellipsoid, impulses of ball and joints, flight and ground. In Jupyter it is shown
    as the result of its cell. The view needs a notebook that runs on this machine.

    Args:
        leg: with at most 8 joints of one number; with None, `Leg.human()`.
        ball: with None, `Ball()`.
        air: with None, `Air()`.

    Attributes:
        sliders: by name: the joints [deg], `foot speed` [m/s], `foot direction` and `normal` [deg
            above the horizontal], `restitution`, `friction`, and `spin`, the back spin of the ball
            before the impact [rad/s].
        impact: the latest one.
        path: its flight.
        message: why the position of the sliders has no kick; empty if it has one.

    Raises:
        InvalidInput: ipywidgets is not installed, or a leg with too many joints.
    """

    @validation.check_arguments
    def __init__(
        self, leg: Leg | None = None, ball: Ball | None = None, air: Air | None = None
    ) -> None:
        validation.check_installed("ipywidgets", "notebooks", "sliders")
        import ipywidgets

        self._leg = leg or Leg.human()
        self._ball, self._air = ball or Ball(), air or Air()
        joints = self._leg.single_joints
        if not 0 < len(joints) <= MOST_SLIDERS:
            raise InvalidInput(
                f"the leg has {len(joints)} joints: sliders take 1 to {MOST_SLIDERS}, lock others"
            )
        self._joints = joints
        low, high = (
            self._leg.display_values(np.where(np.isfinite(ends), ends, side * math.pi))
            for ends, side in ((self._leg.lower, -1), (self._leg.upper, 1))
        )
        ranges = {
            name: (START.get(name, 0.0), low[name][0], high[name][0], 1.0, " [°]")
            for name in joints
        } | RANGES
        self.sliders = {
            name: ipywidgets.FloatSlider(
                min(max(start, least), most), min=least, max=most, step=step,
                description=f"{name}{unit}",
                style={"description_width": "9em"}, readout_format=".4",
            )
            for name, (start, least, most, step, unit) in ranges.items()
        }  # fmt: skip
        self.message = ""
        self.impact, self.path = self._kick()
        self.view: View = show(self.impact, self.path, browser=False, still=True)
        self._note = ipywidgets.HTML()
        for slider in self.sliders.values():
            slider.observe(self._move, "value")
        frame = ipywidgets.HTML(self.view._repr_html_(), layout={"width": "100%"})
        wrap = {"flex_flow": "row wrap"}  # as many beside each other as fit
        rows = ipywidgets.Box([*self.sliders.values()], layout=wrap)
        self._box: Any = ipywidgets.VBox([rows, self._note, frame])

    def _kick(self) -> tuple[Impact, Flight]:
        values = {name: float(slider.value) for name, slider in self.sliders.items()}
        angles = {name: math.radians(values[name]) for name in self._joints}
        posture = self._leg.posture(self._leg.configuration(angles))
        direction, normal = (
            np.array([math.cos(math.radians(rise)), 0.0, math.sin(math.radians(rise))])
            for rise in (values["foot direction"], values["normal"])
        )
        contact = Contact(normal, values["restitution"], values["friction"])
        spin = (0.0, -values["spin"], 0.0)
        v = posture.joint_velocity(values["foot speed"] * direction)
        impact = strike(posture, v, self._ball, contact, ball_spin=spin)
        return impact, fly(impact.ball_after, self._ball, self._air)

    def _move(self, change: object = None) -> None:
        try:
            self.impact, self.path = self._kick()
        except KickdynError as error:
            self.message = str(error)
        else:
            self.message = ""
            self.view.update(self.impact, self.path)
        self._note.value = self.message

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        bundle: Callable[..., Any] = self._box._repr_mimebundle_
        return bundle(**kwargs)
