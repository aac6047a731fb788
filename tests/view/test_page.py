import html
import json
import re
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest
import trimesh

import kickdyn as kd
from kickdyn.view import marks
from kickdyn.view.camera import LEFT, RIGHT, UP
from kickdyn.view.page import page_of_pages


@pytest.fixture(scope="module")
def page(kick):
    impact, _, path = kick
    return kd.page(impact, path, caption="best of 12").html


def test_a_page_needs_nothing_else(page):
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", page)
    assert "<title>leg_human: ball at 10.12 m/s</title>" in page
    assert "best of 12" in page


def test_names_are_escaped(load, spoil):
    evil = "&lt;script&gt;alert(1)&lt;/script&gt;"
    leg = load(spoil(('robot name="leg"', f'robot name="{evil}"'), ('"knee"', f'"{evil}"')))
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    text = kd.page(hit, caption="<script>alert(1)").html
    assert "<script>alert(1)" not in text
    assert text.count("&lt;script&gt;alert(1)") == 5  # title, heading, caption, joint, worst joint


def test_a_leg_with_a_mesh(leg_looking_like, tmp_path, commands_of):
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.stl")
    leg = leg_looking_like('<visual><geometry><mesh filename="box.stl"/></geometry></visual>')
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    said = commands_of(kd.page(hit).html)
    (drawn,) = (c for c in said if c["path"] == "/meshcat/leg/1/0" and c["type"] == "set_object")
    assert drawn["object"]["geometries"][0]["type"] == "BufferGeometry"
    assert "images" not in drawn["object"]


def test_a_leg_with_a_mesh_from_elsewhere(leg_looking_like):
    leg = leg_looking_like('<visual><geometry><mesh filename="../a.stl"/></geometry></visual>')
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    page = kd.page(hit)
    (warning,) = page.warnings
    assert "1 of 1 visuals of leg is not drawn: mesh '../a.stl' is refused" in warning
    assert f'<p class="warning">{html.escape(warning)}</p>' in page.html
    assert kd.page([hit, hit]).warnings == (warning,)  # once


def test_a_page_shows_the_warnings_of_its_subject():
    leg, ball, wide = (
        kd.Leg.human(),
        kd.Ball(),
        kd.Contact((2, 0, 1), ((1.0, 0.8), (3.0, 0.6)), 0.2),
    )
    posture = leg.posture([2.4, 0.2, 0.1])
    hit = kd.strike(posture, posture.joint_velocity([20.0, 0.0, 10.0]), ball, wide)
    path = kd.fly(hit.ball_after, ball, kd.Air(lift="wang"))
    scene = kd.Scene(posture, hit.v_before, ball, wide, air=kd.Air(lift="wang"))
    simulation = kd.simulate(scene, None)
    motion = replace(plan_of_the_human().motion, warnings=("too hard",))
    subjects = [
        (posture, posture.warnings), (hit, hit.warnings), (motion, motion.warnings),
        (simulation, simulation.warnings), (scene, simulation.warnings),
    ]  # fmt: skip
    pages = [(kd.page(hit, path), (*hit.warnings, *path.warnings))]
    for page, warnings in [*pages, *((kd.page(subject), lines) for subject, lines in subjects)]:
        assert warnings
        for line in warnings:
            assert f'<p class="warning">{html.escape(line.partition("; ")[0])}</p>' in page.panel


def plan_of_the_human():
    return kd.plan_kick(kd.Leg.human(), kd.Goal(9, time=0.9), kd.Ball(), None, motion=True)


def test_a_page_replaces_a_file_as_a_whole(kick, tmp_path, monkeypatch):
    file, page = tmp_path / "kick.html", kd.page(kick[0])
    file.write_text("old")
    page.save(file)
    whole = file.read_text(encoding="utf-8")
    assert whole.startswith("<!DOCTYPE html>")
    monkeypatch.setattr("pathlib.Path.write_text", disk_full)
    with pytest.raises(kd.InvalidInput, match=r"cannot be written \(No space left"):
        page.save(file)
    assert [(f.name, f.read_bytes()) for f in tmp_path.iterdir()] == [("kick.html", whole.encode())]


def disk_full(self, text, **_):
    self.write_bytes(text[:4].encode())
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize(
    "name",
    ["missing/kick.html", "folder.html", "kick.docx", "kick", "file/kick.html", "/proc/a.html"],
)
def test_a_page_that_cannot_be_written(tmp_path, name, kick):
    (tmp_path / "folder.html").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(kd.InvalidInput, match=name) as caught:
        kd.page(kick[0]).save(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert {f.name for f in tmp_path.iterdir()} == {"folder.html", "file"}


def test_swapped_arguments_of_save_are_refused_in_a_short_line(tmp_path, kick, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = kd.page(kick[0])
    for wrong in ((0.5, "kick.html"), ("kick.html", "kick.png"), (made.html,), (made, "kick.html")):
        with pytest.raises(kd.InvalidInput) as refused:
            made.save(*wrong)
        assert len(str(refused.value)) < 400
    assert list(tmp_path.iterdir()) == []


def test_a_time_that_a_page_or_picture_does_not_show_is_refused(tmp_path, kick, monkeypatch):
    pictures = []
    monkeypatch.setattr("kickdyn.view.page.save_picture", lambda _, *how: pictures.append(how))
    hit, _, flight = kick
    made, end = kd.page(hit, flight), flight.duration
    for name, time in (("kick.html", 99), ("kick.png", 99), ("kick.png", 1.01 * end)):
        with pytest.raises(kd.InvalidInput, match=f"at is {float(time):g}.*at most"):
            made.save(tmp_path / name, time)
    made.save(tmp_path / "kick.png", 0.9 * end)
    assert pictures == [(tmp_path / "kick.png", 0.9 * end)]
    assert list(tmp_path.iterdir()) == []


def test_a_page_alone_has_no_buttons(kick):
    assert "<nav>" not in kd.page(kick[0]).html


def test_one_page_of_several(make_kick, tmp_path):
    pages = {f"{speed} m/s": kd.page(make_kick(kd.Leg.human(), speed)[0]) for speed in (1, 2)}
    pages["1 m/s"].warnings, pages["2 m/s"].warnings = ("both", "first"), ("both", "second")
    made = page_of_pages(pages)
    assert made.warnings == ("both", "first", "second")
    assert made.title == pages["1 m/s"].title
    assert re.findall("<button>(.* m/s)</button>", made.html) == ["1 m/s", "2 m/s"]
    for one in pages.values():
        assert one.panel in made.html
    assert len(made.html) < sum(len(one.html) for one in pages.values()) - 1_000_000


def test_several_impacts_have_a_button_and_a_panel_each(make_kick):
    hits = {name: make_kick(kd.Leg.human(), speed)[0] for name, speed in (("slow", 1), ("<b>", 2))}
    made = kd.page(hits, caption="two")
    assert re.findall("<button>(.*?)</button>", made.html)[1:] == ["slow", "&lt;b&gt;"]
    for hit in hits.values():
        assert kd.page(hit, caption="two").panel in made.html
    assert list(kd.page([*hits.values()]).pages) == ["1", "2"]


def test_a_bare_impact_is_drawn_above_the_lowest_point_of_the_leg(make_kick):
    """An impact does not say where the ground is, but a plan, a scene and a course do."""
    hit, ball, _ = make_kick(kd.Leg.human(), 2.0, degrees=(40, 30, -20))
    for caption in ("a kick", "a kick."):
        panel = kd.page(hit, caption=caption).panel
        assert "<p>a kick. </p>" in panel
        assert "<p>The ball is on a tee" in panel
    scene = kd.Scene(hit.posture, hit.v_before, ball, hit.contact)
    course = kd.follow(
        hit.ball_after, ball, ground=kd.Ground(hit.ball_before.position[2] - ball.radius, "turf")
    )
    for subject in ((scene,), (hit, course)):
        shown = kd.page(*subject).html
        assert "on a tee" not in shown


def test_the_page_in_a_browser(page, chromium, tmp_path):
    file, picture = tmp_path / "kick.html", tmp_path / "kick.png"
    file.write_text(page, encoding="utf-8")
    chromium(
        f"{file.as_uri()}#at=-9", f"--screenshot={picture}", "--window-size=1280,720"
    )  # when labels are hidden
    pixels = 255 * matplotlib.image.imread(picture)[:, 330:, :3].astype(float)  # beside the caption
    red, green, blue = np.moveaxis(pixels, -1, 0)

    def of(colour):
        return np.abs(pixels - (colour >> 16, colour >> 8 & 255, colour & 255)).max(axis=-1) < 2

    # Light changes how bright the skin is, not its hue.
    skin = (np.abs(red / green.clip(1) - 0.85 / 0.64) < 0.06) & (
        np.abs(green / blue.clip(1) - 0.64 / 0.49) < 0.06
    )
    panels = (red > 170) & (np.abs(red - green) < 4) & (red >= blue) & (red - blue < 12)
    assert (skin & (red > 60)).sum() > 2000
    assert panels.sum() > 300
    assert of(marks.CURVE).sum() > 500
    assert of(marks.GRASS[0]).sum() > 10_000


def test_controls_are_shown_when_asked_for(page, chromium, tmp_path):
    look = """<script>setTimeout(() => {
      document.title = getComputedStyle(document.querySelector(".dg.main")).display;
    }, 500);</script></body>"""
    file = tmp_path / "kick.html"
    file.write_text(page.replace("</body>", look))
    for end, display in (("", "none"), ("#controls", "block")):
        dom = chromium(file.as_uri() + end, "--dump-dom")
        assert re.search("<title>(.*?)</title>", dom)[1] == display


def test_the_page_plays_for_ever(page, chromium, tmp_path):
    look = """<script>setTimeout(() => {
      const a = viewer.animator;
      document.title = JSON.stringify(
        [a.playing, a.time, a.actions.length, a.actions.every(x => x.repetitions === Infinity),
         performance.getEntriesByType("resource").length]);
    }, 1500);</script></body>"""
    (tmp_path / "kick.html").write_text(page.replace("</body>", look))
    dom = chromium((tmp_path / "kick.html").as_uri(), "--dump-dom")
    playing, time, actions, for_ever, fetched = json.loads(
        re.search("<title>(.*?)</title>", dom)[1]
    )
    assert playing
    assert time > 0.2
    assert actions == 8
    assert for_ever
    assert fetched == 0


def test_the_address_names_a_time_that_the_page_shows(page, kick, chromium, tmp_path):
    look = """<script>setTimeout(() => {
      document.title = document.querySelector("#time output").value;
    }, 500);</script></body>"""
    file = tmp_path / "kick.html"
    file.write_text(page.replace("</body>", look))
    late = f"{kick[2].duration:.3f} s after the impact"
    for at, shown in (("0", "0.000 s after the impact"), ("0.25", "0.250 s after the impact"),
                      ("-0.004", "0.004 s before the impact"), ("99", late)):  # fmt: skip
        dom = chromium(f"{file.as_uri()}#at={at}", "--dump-dom")
        assert re.search("<title>(.*?)</title>", dom)[1] == shown


LABELS = """<script>setTimeout(() => {
  const {right, bottom} = document.querySelector("#caption").getBoundingClientRect();
  const {scrollWidth, scrollHeight} = document.documentElement;
  document.title = JSON.stringify([innerWidth, innerHeight,
    right, bottom, scrollWidth, scrollHeight,
    [...document.querySelectorAll(".label:not(.mark)")].map(each => {
      const {left, top, width, height} = each.getBoundingClientRect();
      return [each.innerText, each.style.visibility, left, top, width, height];
    })]);
}, 1500);</script></body>"""


def labels_in(chromium, page, file, at, size="1280,850"):
    file.write_text(page.replace("</body>", LABELS))
    dom = chromium(f"{file.as_uri()}#at={at}", "--dump-dom", f"--window-size={size}")
    return json.loads(html.unescape(re.search("<title>(.*?)</title>", dom)[1]))


def overlaps(labels):
    """Return the pairs of labels, (text, visibility, left, top, width, height), that overlap."""
    return [
        (one, two)
        for number, one in enumerate(labels)
        for two in labels[:number]
        if one[2] < two[2] + two[4] and two[2] < one[2] + one[4] and abs(one[3] - two[3]) < 20
    ]


def test_labels_stand_beside_their_arrows_and_not_over_each_other(
    page, kick, chromium, tmp_path, commands_of
):
    wide, high, right, bottom, *scrolled, shown = labels_in(
        chromium, page, tmp_path / "kick.html", 0.01
    )
    assert scrolled == [wide, high]  # so that there are no scroll bars
    for _, _, x, y, w, h in shown:
        assert x > right or y > bottom  # not under the caption
        assert x + w < wide
        assert 0 < y < high - h
    sizes = [kick[0].impulse, *kick[0].joint_impulses[:, :3]]
    assert sorted(each[0] for each in shown) == sorted(
        [f"{kick[2].range:.3g} m", *(f"{np.linalg.norm(size):.3g} N s" for size in sizes)]
    )
    assert {visibility for _, visibility, *_ in shown} == {"visible"}
    assert overlaps(shown) == []
    said = commands_of(page)
    moved = {c["path"]: np.array(c["matrix"][12:15]) for c in said if c["type"] == "set_transform"}
    (x, y, z) = next(c["value"] for c in said if c.get("property") == "position"
                     and "Cameras" in c["path"])  # fmt: skip
    eye = np.array([x, -z, y])  # the scene is moved so that the camera looks at the origin
    into = -eye / np.linalg.norm(eye)
    right = np.cross(into, (0, 0, 1)) / np.linalg.norm(np.cross(into, (0, 0, 1)))
    away = moved["/meshcat"] + moved["/meshcat/arrow"] + moved["/meshcat/arrow/label"] - eye
    across, up = (away @ axis / (away @ into) for axis in (right, np.cross(right, into)))
    _, _, x, y, _, h = shown[0]  # of the ball's impulse, which points to the right
    assert x == pytest.approx(wide / 2 + high / 2 * across / UP + 6, abs=1.0)
    assert y + h / 2 == pytest.approx(high / 2 - high / 2 * up / UP, abs=1.0)


def test_labels_are_hidden_before_the_impact_and_move_on_along_their_arrows(
    kick, chromium, tmp_path
):
    far = kd.page(kick[0], kd.fly(kd.BallState(velocity=(3e3, 0, 3e3)), kick[1])).html
    *_, shown = labels_in(chromium, far, tmp_path / "kick.html", 0)
    assert {visibility for _, visibility, *_ in shown} == {"visible"}
    assert overlaps(shown) == []
    *_, shown = labels_in(chromium, far, tmp_path / "kick.html", -9)
    *arrows, end = shown
    assert {visibility for _, visibility, *_ in arrows} == {"hidden"}
    assert end[1] == "visible"


def test_labels_stay_in_a_narrow_window(page, chromium, tmp_path):
    wide, *_, shown = labels_in(chromium, page, tmp_path / "kick.html", 0, "600,900")
    assert all(x >= 0 and x + w <= wide for _, _, x, _, w, _ in shown)
    assert overlaps(shown) == []


def test_in_a_narrow_window_the_numbers_stand_below(page, chromium, tmp_path):
    look = """<script>setTimeout(() => {
      const box = name => document.querySelector(name).getBoundingClientRect();
      document.title = JSON.stringify(
        [box("canvas").height, box("#meshcat-pane").bottom, box("#caption").top, innerHeight]);
    }, 1500);</script></body>"""
    (tmp_path / "kick.html").write_text(page.replace("</body>", look))
    dom = chromium((tmp_path / "kick.html").as_uri(), "--dump-dom", "--window-size=800,600")
    canvas, bottom, top, window = json.loads(re.search("<title>(.*?)</title>", dom)[1])
    assert canvas == pytest.approx(bottom, abs=1.0)
    assert top == pytest.approx(bottom, abs=1.0)
    assert bottom == pytest.approx(0.66 * window, abs=2.0)


@pytest.mark.parametrize("size", ["500,900", "1280,800"])
def test_every_window_shows_what_the_camera_was_placed_for(size, page, chromium, tmp_path):
    """Slopes at the edges of the picture, from the lens; where the caption lies over it, beside."""
    look = """<script>setTimeout(() => {
      const {elements: m} = viewer.camera.projectionMatrix, box = name =>
        document.querySelector(name).getBoundingClientRect();
      const over = box("#caption").top < box("#meshcat-pane").bottom ? box("#caption").right : 0;
      document.title = JSON.stringify([2 * over / innerWidth - 1, m[0], m[8], m[5]]);
    }, 1500);</script></body>"""
    (tmp_path / "kick.html").write_text(page.replace("</body>", look))
    dom = chromium((tmp_path / "kick.html").as_uri(), "--dump-dom", f"--window-size={size}")
    start, x, shift, y = json.loads(re.search("<title>(.*?)</title>", dom)[1])
    assert (start > -1) == size.startswith("1280")
    assert (start + shift) / x <= -LEFT
    assert (1 + shift) / x >= RIGHT - 1e-9
    assert 1 / y >= UP - 1e-9


def test_the_page_is_in_a_frame_of_a_notebook_as_it_is(kick):
    page = kd.page(kick[0])
    frame = re.fullmatch(r'<iframe srcdoc="([^"]*)" sandbox="allow-scripts" style="(.*)"></iframe>',
                         page._repr_html_())  # fmt: skip
    assert html.unescape(frame[1]) == page.html
    assert "<" not in frame[1]
    assert "height: 600px" in frame[2]
    assert repr(page) == "<Page 'leg_human: ball at 10.12 m/s': save it as .html, .png or .glb>"


def test_a_notebook_in_a_browser(kick, chromium, tmp_path):
    """The kick is drawn above its caption, and its frame sees nothing of the notebook."""
    spy = "<script>try { parent.document.body.innerHTML = 0; } catch (e) {}</script></body>"
    page = kd.page(kick[0])._repr_html_()
    frame = page.replace(html.escape("</body>"), html.escape(spy))
    assert frame != page
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


def test_a_kick_without_a_path_flies_through_air(kick):
    impact = kick[0]
    text = kd.page(impact).html
    assert f"{kd.fly(impact.ball_after, impact.ball, kd.Air()).range:.4g} m" in text
    vacuum = kd.page(impact, kd.fly(impact.ball_after, impact.ball)).html
    assert f"{kd.fly(impact.ball_after, impact.ball).range:.4g} m" in vacuum


def test_flights_courses_and_passes_are_curves(commands_of):
    ball, ground = kd.Ball(), kd.Ground(surface="turf")
    path = kd.fly(kd.BallState(velocity=(20, 0, 9)), ball)
    launch = kd.BallState((0, 0, ball.radius), (5.0, 0, 0))
    course = kd.follow(launch, ball, None, ground)
    found = kd.plan_launch(kd.Goal(10, time=1), ball, kd.Air())
    for shown, count in ((path, 1), (course, 1), ([path, course], 2), ({"a": path}, 1), (found, 1)):
        commands = commands_of(kd.page(shown).html)
        curves = [c for c in commands if c["path"].startswith("/meshcat/curve")]
        assert len(curves) == count
    assert f"{course.distance:.4g} m along the ground" in kd.page(course).html


def test_what_a_page_cannot_show(kick):
    impact, _, path = kick
    for shown, reason in (
        (1, "subject is 1: it must be a kickdyn.Impact, a kickdyn.KickPlan, "),
        ("kick", "cannot show a str"),
        ([impact, path], "compares flights or impacts, not both"),
        ([], "there are 0"),
    ):
        with pytest.raises(kd.InvalidInput, match=reason):
            kd.page(shown)
    with pytest.raises(kd.InvalidInput, match="path is given with a Flight"):
        kd.page(path, path)


def test_the_wall_of_a_scene_stands_on_the_lower_of_both_ends(kick, commands_of):
    hit, ball, _ = kick
    posture = hit.posture
    scene = kd.Scene(
        posture,
        hit.v_before,
        ball,
        hit.contact,
        plane=kd.Plane((3, 0, 0), (-1, 0, 0)),
    )
    answer = kd.simulate(scene, tolerance=0.1)
    heights = scene.ball_position[2], answer.end.position[2]
    assert abs(heights[0] - heights[1]) > 0.05
    shown = [c for c in commands_of(kd.page(answer).html) if c["path"] == "/meshcat/scenery/0"]
    box, placed = (next(c for c in shown if c["type"] == kind)
                   for kind in ("set_object", "set_transform"))  # fmt: skip
    bottom = placed["matrix"][14] - box["object"]["geometries"][0]["depth"] / 2
    assert bottom == pytest.approx(min(heights) - ball.radius)
