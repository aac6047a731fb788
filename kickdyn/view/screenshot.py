"""A page as a picture: a screenshot by Chromium without a window."""

import os
import shutil
import subprocess
import tempfile
from os import PathLike
from pathlib import Path

from kickdyn.core.files import replacing
from kickdyn.errors import InvalidInput, KickdynError

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
TIMEOUT = 120.0  # of Chromium [s]

# The picture is drawn without a graphics processor, so that it is the same everywhere.
_FLAGS = (
    "--headless=new --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--hide-scrollbars --disable-background-networking --disable-component-update --disable-sync "
    "--no-first-run --virtual-time-budget=3000 --window-size=1280,720"
)


def find_browser(path: str | PathLike[str]) -> str:
    """Return the browser that draws a picture at `path`.

    Raises:
        InvalidInput: there is none, or the name does not end in `.png`.
    """
    if Path(path).suffix.lower() != ".png":
        raise InvalidInput(f"{path} has no known ending: pictures of a page are written as .png")
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise InvalidInput(
            "a picture of a page needs Chromium: install it (Debian package chromium), "
            "or write the page alone"
        )
    return browser


def save_picture(html: str, path: str | PathLike[str], at: float = 0.0) -> None:
    """Write a page as a PNG, at a time from the impact [s].

    Raises:
        InvalidInput: there is no Chromium, or the file cannot be written.
        KickdynError: Chromium failed.
    """
    browser = find_browser(path)
    # Chromium's sandbox refuses to run as root; the page may load and call nothing anyway.
    rooted = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with replacing(path) as draft, tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        page.write_text(html, encoding="utf-8")
        files = [f"--user-data-dir={folder}/profile", f"--screenshot={draft}"]
        command = [
            browser,
            *_FLAGS.split(),
            *rooted,
            *files,
            f"{page.as_uri()}#picture&at={at:.9g}",
        ]
        try:
            done = subprocess.run(command, capture_output=True, timeout=TIMEOUT, check=False)
        except subprocess.TimeoutExpired:
            raise KickdynError(f"{browser} did not end within {TIMEOUT:g} s") from None
        if b"No usable sandbox" in done.stderr:
            raise KickdynError(
                f"{browser} cannot use its sandbox here: install the Debian package "
                "chromium-sandbox or, in a container that does not allow it, put a script named "
                "chromium first on PATH that starts it with --no-sandbox"
            )
        if done.returncode != 0 or not draft.exists():
            raise KickdynError(f"{browser} made no picture (it ended with {done.returncode})")
