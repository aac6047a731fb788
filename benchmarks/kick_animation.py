"""Draw docs/images/kick.webp, the animated picture of README.md, from the page of a planned kick.

    python benchmarks/kick_animation.py [FILE]

Needs Chromium and the extras `robots` and `motion`. Chromium draws each picture anew, which takes
some minutes.
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

PICTURES = 8
"""Number of pictures per second."""

LAST = 1.5
"""How long the last picture is shown [s]."""


def page() -> Page:
    """Return the page of a kick with its motion by a humanoid robot that stands on its left foot.

    Its arms are locked aside, out of the way of the thigh.
    """
    robot = kd.Leg.from_robot("g1", base="floating")
    arms_and_waist = ("shoulder", "elbow", "wrist", "waist")
    angles = dict.fromkeys(
        (n for n in robot.joint_names if any(part in n for part in arms_and_waist)), 0.0
    )
    for side, sign in (("left", 1.0), ("right", -1.0)):
        angles[f"{side}_shoulder_pitch_joint"] = -0.5
        angles[f"{side}_shoulder_roll_joint"] = sign * 1.4
        angles[f"{side}_elbow_joint"] = 1.0
    foot = kd.Support("left_ankle_roll_link", friction=0.7)
    standing = robot.locked(angles).with_supports(foot)
    return kd.page(kd.plan_kick(standing, kd.Goal(2, time=0.4), kd.Ball(), kd.Air(), motion=True))


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
