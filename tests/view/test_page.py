"""Pages of every kind of subject: their numbers, warnings and files; and what a browser shows."""

import re

import pytest
from drawn_scene import DrawnScene

import kickdyn as kd


@pytest.fixture(scope="module")
def page(kick):
    impact, _, path = kick
    return kd.page(impact, path, caption="best of 12")


def test_a_page_of_a_kick_is_one_file_with_its_numbers(page, kick):
    impact, ball, path = kick
    assert f"<title>leg_human: ball at {impact.ball_after.speed:.4g} m/s</title>" in page.html
    assert "best of 12" in page.html
    assert "<nav>" not in page.html
    assert f"{path.range:.4g} m" in page.panel
    without = kd.fly(impact.ball_after, ball)
    assert f"{without.range:.4g} m" in kd.page(impact, without).panel
    assert f"{kd.fly(impact.ball_after, ball, kd.Air()).range:.4g} m" in kd.page(impact).panel


def test_a_bare_impact_is_above_the_lowest_point_of_the_leg_and_a_scene_is_not(make_kick):
    """An impact does not say where the ground is, but a plan, a scene and a course do."""
    hit, ball, _ = make_kick(kd.Leg.human(), 2.0, degrees=(40, 30, -20))
    bottom = hit.ball_before.position[2] - ball.radius
    bare = kd.page(hit, caption="a kick.")
    assert "<p>a kick. </p>" in bare.panel
    assert "tee" in bare.panel
    assert DrawnScene(bare.viewer).point("ground")[2] < bottom - 0.01
    course = kd.follow(hit.ball_after, ball, ground=kd.Ground(bottom, "turf"))
    for subject in ((kd.Scene(hit.posture, hit.v_before, ball, hit.contact),), (hit, course)):
        shown = kd.page(*subject)
        assert "tee" not in shown.panel
        assert DrawnScene(shown.viewer).point("ground")[2] == pytest.approx(bottom)


def test_the_wall_of_a_scene_stands_on_the_lower_of_both_ends(kick):
    hit, ball, _ = kick
    plane = kd.Plane((3, 0, 0), (-1, 0, 0))
    scene = kd.Scene(hit.posture, hit.v_before, ball, hit.contact, plane=plane)
    answer = kd.simulate(scene, tolerance=0.1)
    heights = scene.ball_position[2], answer.end.position[2]
    shown = DrawnScene(kd.page(answer).viewer)
    x, _, z = shown.point("scenery/0")
    box = shown.shape("scenery/0")
    assert z - box["depth"] / 2 == pytest.approx(min(heights) - ball.radius)
    assert x - box["width"] / 2 == pytest.approx(3.0)  # the plane
    # players stand on the ground, here 0.4 m below the ball, in front of it
    level = heights[0] - ball.radius - 0.4
    walled = scene.replace(wall=kd.Wall(1.2, 0.3), ground=kd.Ground(level))
    shown = DrawnScene(kd.page(kd.simulate(walled, tolerance=0.1)).viewer)
    right = scene.ball_position[0] + 1.2, scene.ball_position[1], level + 0.3 / 2
    assert shown.point("scenery/3") == pytest.approx(right)  # the third of five


def test_several_impacts_have_a_page_with_a_button_each(make_kick):
    kicks = {str(speed): make_kick(kd.Leg.human(), speed)[0] for speed in (4.0, 6.0)}
    whole = kd.page(kicks)
    assert re.findall("<button>(.*?)</button>", whole.html)[-2:] == list(kicks)
    for name, hit in kicks.items():
        speed = f"{hit.ball_after.speed:.4g} m/s"
        assert f"Ball at {speed}" in whole.pages[name].panel
        assert (speed in whole.title) == (name == "4.0")
    with pytest.raises(kd.InvalidInput, match="not both"):
        kd.page([kicks["4.0"], kd.fly(kicks["4.0"].ball_after, kd.Ball())])


def test_a_page_is_written_whole_or_refused(tmp_path, page):
    for name in ("missing/kick.html", "kick.docx"):
        with pytest.raises(kd.InvalidInput, match=name):
            page.save(tmp_path / name)
    page.save(tmp_path / "kick.html")
    assert (tmp_path / "kick.html").read_text("utf-8") == page.html
