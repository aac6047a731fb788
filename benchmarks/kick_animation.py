"""Draw docs/images/kick.webp, the animated picture of README.md: a kick carried out in MuJoCo.

    python benchmarks/kick_animation.py [FILE]

Needs Chromium and the extras `robots`, `motion` and `mjcf`. Chromium draws each picture anew, which
takes some minutes.
"""

import sys
import tempfile
from pathlib import Path

from PIL import Image

import kickdyn as kd
from kickdyn.view.document import save_picture
from kickdyn.view.kick_scene import RATE
from kickdyn.view.page import Page

FILE = Path(__file__).resolve().parent.parent / "docs" / "images" / "kick.webp"

SIZE = 880, 495
"""Width and height of the animation [px]."""

PICTURES = 6
"""Number of pictures per second."""

LAST = 1.5
"""How long the last picture is shown [s]."""


def page() -> Page:
    """Return the page of a kick of G1 from its left foot, corrected twice, beside its plan."""
    robot = kd.Leg.from_robot("g1", base="floating", locked={"*wrist*": 0.0})
    standing = robot.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))
    plan = kd.plan_kick(standing, kd.Goal(3, time=0.4), kd.Ball(), kd.Air(), motion=True)
    corrected = kd.refine_kick(plan, rounds=2, by="mujoco", foot="plate")
    return kd.page(kd.run_in_mujoco(corrected, foot="plate"))


def main(file: Path) -> None:
    """Write the animation."""
    shown = page()
    assert shown.pace is not None
    duration = (len(shown.pace.times) - 1) / RATE
    moments = [number / PICTURES for number in range(int(duration * PICTURES) + 1)]
    times = [float(shown.pace.times[round(moment * RATE)]) for moment in moments]
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "picture.png"
        for time in times:
            save_picture(shown.html, picture, time)
            pictures.append(
                Image.open(picture).convert("RGB").resize(SIZE, Image.Resampling.LANCZOS)
            )
    shown_for = [round(1e3 / PICTURES)] * (len(times) - 1) + [round(1e3 * LAST)]
    pictures[0].save(
        file, save_all=True, append_images=pictures[1:], duration=shown_for, loop=0, quality=75,
        method=6,
    )  # fmt: skip
    print(f"{file.name}: {len(times)} pictures, {file.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FILE)
