import html
import re

import matplotlib.image
import numpy as np
import pytest

import kickdyn as kd
from kickdyn.view import marks
from kickdyn.view.inline import Inline
from kickdyn.view.kick_page import kick_page


def test_the_page_is_in_the_frame_as_it_was():
    page = """<!DOCTYPE html><p title='a' id="b">&lt;1 &amp; 2</p><script>1 < 2 && "x"</script>"""
    frame = Inline(page, height=300)._repr_html_()
    said = re.fullmatch(r'<iframe srcdoc="([^"]*)" sandbox="allow-scripts" style="(.*)"></iframe>',
                        frame)  # fmt: skip
    assert html.unescape(said[1]) == page
    assert "<" not in said[1]
    assert "height: 300px" in said[2]


def test_without_a_browser_it_says_what_it_is():
    assert repr(Inline("a" * 1_200_000)) == "<a page of 1.2 MB, for a browser>"


@pytest.mark.parametrize("height", [0, -1, float("nan"), "tall"])
def test_bad_heights(height):
    with pytest.raises(kd.InvalidInput, match="height is"):
        Inline("page", height)


def test_in_a_browser(kick, chromium, tmp_path):
    """The kick is drawn above its caption, and its frame sees nothing of the notebook."""
    spy = "<script>try { parent.document.body.innerHTML = 0; } catch (e) {}</script></body>"
    frame = Inline(kick_page(*kick).replace("</body>", spy), height=600)._repr_html_()
    file, picture = tmp_path / "notebook.html", tmp_path / "notebook.png"
    file.write_text(f"<!DOCTYPE html><body style='width: 800px'>{frame}")
    chromium(file.as_uri(), f"--screenshot={picture}", "--virtual-time-budget=15000")
    pixels = 255 * matplotlib.image.imread(picture)[:600, :800, :3].astype(float)

    def of(colour, part):
        wanted = (colour >> 16, colour >> 8 & 255, colour & 255)
        return int((np.abs(part - wanted).max(axis=-1) < 2).sum())

    above, below = pixels[:396], pixels[410:]
    assert of(marks.GRASS[0], above) > 10_000
    assert of(marks.CURVE, above) > 200
    assert of(marks.GRASS[0], below) == 0
