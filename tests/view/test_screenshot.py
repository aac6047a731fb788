import matplotlib.image
import numpy as np
import pytest

import kickdyn as kd
from kickdyn.view import screenshot as photo
from kickdyn.view.screenshot import find_browser, save_picture


def test_without_a_browser_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(photo.shutil, "which", lambda name: None)
    with pytest.raises(kd.InvalidInput, match="Debian package chromium") as caught:
        find_browser("a.png")
    assert "\n" not in str(caught.value)


def test_only_png():
    with pytest.raises(kd.InvalidInput, match=r"a\.jpg has no known ending"):
        find_browser("a.jpg")


def test_a_browser_that_fails_leaves_nothing(monkeypatch, tmp_path):
    monkeypatch.setattr(photo.shutil, "which", lambda name: "/bin/false")
    with pytest.raises(kd.KickdynError, match="made no picture"):
        save_picture("page", tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_a_browser_without_its_sandbox_says_what_helps(monkeypatch, tmp_path):
    browser = tmp_path / "chromium"
    browser.write_text("#!/bin/sh\necho 'No usable sandbox! If this is' >&2\nexit 1\n")
    browser.chmod(0o755)
    monkeypatch.setattr(photo.shutil, "which", lambda name: str(browser))
    with pytest.raises(kd.KickdynError, match="Debian package chromium-sandbox"):
        save_picture("page", tmp_path / "a.png")


def test_the_moment_is_what_was_asked_for(kick, chromium, tmp_path):
    """The ball is in the air at the middle of its flight, and not at the impact."""
    impact, _, path = kick
    page = kd.page(impact, path)
    pictures = []
    for number, at in enumerate((0.0, path.duration / 2)):
        page.save(tmp_path / f"{number}.png", at)
        pictures.append(matplotlib.image.imread(tmp_path / f"{number}.png")[:, :, :3])
    assert pictures[0].shape == (720, 1280, 3)
    assert (np.abs(pictures[0] - pictures[1]).max(axis=-1) > 0.2).sum() > 500
