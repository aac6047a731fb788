"""meshcat scenes in memory, and the HTML that shows them: one file that needs no network.

A page shows one scene at a time; buttons choose among several. At the end of the page's address,
`#scene=2&at=1.5` shows the third scene and stops its animation at 1.5 s, `#picture` hides what
is of use in a browser only, and `#controls` shows meshcat's own controls.
"""

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

import meshcat
import meshcat.transformations as tf
import umsgpack

from kickdyn.core.validation import Array
from kickdyn.view.camera import LEFT, RIGHT, UP

# A browser runs and loads what the page itself contains, and refuses everything else.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src 'none'"
)

_STYLE = """
html { font-size: clamp(14px, 1.2vw, 40px); }  /* a projector's picture is read from afar */
body { margin: 0; font: 1rem/1.4 system-ui, "Segoe UI", Roboto, Helvetica, Arial, sans-serif; }
[hidden] { display: none !important; }
#meshcat-pane { position: relative; width: 100vw; height: 100vh; overflow: hidden; }
.dg.main { display: none; }
#controls:target ~ .dg.main { display: block; }
#caption {
  position: absolute; top: 0.8rem; left: 0.8rem; width: 22rem; max-height: calc(100vh - 1.6rem);
  box-sizing: border-box; overflow: auto; padding: 0.7rem 1rem; border-radius: 8px;
  background: rgba(255, 255, 255, 0.88); color: #1d2733; box-shadow: 0 1px 6px rgba(0, 0, 0, 0.2);
}
#caption h1 { margin: 0 0 6px; font-size: 1.15rem; overflow-wrap: anywhere; }
#caption p { margin: 4px 0 6px; overflow-wrap: anywhere; }
#caption .warning { color: #a33a00; }
#caption table { border-spacing: 0; }
#caption th, #caption td { padding: 1px 0; text-align: left; vertical-align: top; }
#caption .option { white-space: nowrap; }
#caption th { padding-right: 12px; white-space: nowrap; font-weight: normal; color: #5b6774; }
#caption td { font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
#caption details { margin-top: 4px; }
#caption nav { display: flex; flex-wrap: wrap; gap: 4px; margin-bottom: 8px; }
button {
  padding: 2px 8px; border: 1px solid #b9c2cc; border-radius: 5px; background: #fff;
  font: inherit; font-size: 0.95rem; color: inherit; cursor: pointer;
}
button[aria-pressed=true] { background: #1d2733; border-color: #1d2733; color: #fff; }
#time {
  position: absolute; right: 0.8rem; bottom: 0.8rem; left: 23.6rem; display: flex; gap: 10px;
  align-items: center; padding: 6px 12px; border-radius: 8px; color: #1d2733;
  background: rgba(255, 255, 255, 0.75);
}
#time button { width: 4.6rem; }
#time input { flex: 1; min-width: 60px; }
#time output { width: 17em; font-variant-numeric: tabular-nums; white-space: nowrap; }
#caption summary { cursor: pointer; color: #5b6774; }
#caption details th { white-space: normal; }
#caption details tr:not(.long) td { white-space: nowrap; }
#caption .key { display: inline-block; width: 0.7rem; height: 0.7rem; border-radius: 2px; }
.label {
  position: absolute; left: 0; top: 0; padding: 0 6px; border: 2px solid; border-radius: 5px;
  font-size: 1rem; white-space: nowrap; pointer-events: none; visibility: hidden;
  background: rgba(255, 255, 255, 0.88); color: #1d2733;
}
.mark {
  padding: 0; border: 0; background: none; color: #fff; font-weight: 600;
  text-shadow: 0 0 3px #000, 0 0 2px #000;
}
@media (max-width: 1000px) {  /* a notebook's frame or a telephone has no space beside the leg */
  #meshcat-pane { height: 66vh; }
  #caption {
    position: static; width: auto; height: 34vh; max-height: none; padding: 8px 14px;
    border-radius: 0; box-shadow: none; font-size: 13px;
  }
  #time { left: 0.8rem; padding: 2px 10px; font-size: 13px; }
  #caption h1 { font-size: 14px; margin: 0 0 2px; }
  #caption table, #caption tbody { display: block; }
  #caption tbody {
    display: grid; grid-template-columns: repeat(auto-fill, minmax(160px, 1fr)); column-gap: 20px;
  }
  #caption tr { display: flex; }
  #caption tr.long { grid-column: 1 / -1; }
  #caption th { flex: 0 0 auto; }
  #caption tr:not(.long) td { white-space: nowrap; }
  #caption details tbody { grid-template-columns: repeat(auto-fill, minmax(300px, 1fr)); }
}
"""

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<i id="controls"></i>
<div id="meshcat-pane">
{labels}
<div id="time" hidden>
<button>pause</button><input type="range" min="0" step="any" aria-label="time"><output></output>
</div>
</div>
<aside id="caption">
{buttons}{panels}
</aside>
<script>{engine}</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
const resize = viewer.set_3d_pane_size.bind(viewer);  // to the window's height, not the pane's
const below = matchMedia("(max-width: 1000px)");  // the caption is not over the scene
const caption = document.getElementById("caption");
viewer.set_3d_pane_size = () => {{
  const width = viewer.dom_element.offsetWidth, height = viewer.dom_element.offsetHeight;
  const taken = caption.offsetLeft + caption.offsetWidth;
  const lens = viewer.camera, beside = (width - 2 * taken) / {left};
  const extent = below.matches ? width / {spread} : Math.min(width / {right}, beside);
  lens.zoom = Math.min(1, extent / height);  // show all that the camera was set for
  lens.aspect = width / height;
  lens.filmOffset = below.matches ? {aside} * lens.getFilmWidth() : 0;
  resize(width, height);
}};
const commands = [
{commands}
].map(text => Uint8Array.from(atob(text), character => character.charCodeAt(0)));
const scenes = {scenes};  // of each the numbers of its commands, and times: animation, kick [s]
const sun = viewer.scene_tree.find(["Lights", "FillLight", "<object>"]).object;
sun.castShadow = true;
sun.shadow.mapSize.set(2048, 2048);
const wanted = new URLSearchParams(location.hash.slice(1));
let knots = null;
const [toggle, slider, clock] = document.getElementById("time").children;
const show = number => {{
  document.querySelectorAll(".scene").forEach(each => {{
    each.hidden = each.dataset.scene !== String(number);
  }});
  document.querySelectorAll("nav button").forEach((button, each) => {{
    button.setAttribute("aria-pressed", each === number);
  }});
  viewer.animator.clear();
  viewer.delete_path(["meshcat"]);
  viewer.controls.target.set(0, 0, 0);
  // In order and at once; meshcat's own export fetches each command on its own, in any order.
  for (const each of scenes[number].commands) viewer.handle_command_bytearray(commands[each]);
  viewer.scene.traverse(node => {{  // only bodies cast shadows, and only the ground shows them
    if (!node.material) return;
    node.receiveShadow = node.material.type === "ShadowMaterial";
    node.castShadow = node.material.type === "MeshLambertMaterial" && !node.material.transparent;
  }});
  const lens = sun.shadow.camera;
  lens.top = lens.right = sun.reach;
  lens.bottom = lens.left = -sun.reach;
  lens.near = 0.1 * sun.reach;
  lens.far = 2 * sun.position.length();
  lens.updateProjectionMatrix();
  knots = scenes[number].times;
  document.getElementById("time").hidden = !knots || wanted.has("picture");
  slider.max = viewer.animator.duration;
  viewer.set_3d_pane_size();
}};
const seek = time => {{
  if (viewer.animator.playing) viewer.animator.pause();
  viewer.animator.seek(time);
}};
const along = (table, from, to, x) => {{  // the line through the columns of a table, at x
  const next = Math.max(1, table.findIndex(row => row[from] >= x));
  const [start, end] = [table[next - 1], table[next]];
  return start[to] + (end[to] - start[to]) * (x - start[from]) / (end[from] - start[from]);
}};
toggle.onclick = () => {{
  if (viewer.animator.playing) viewer.animator.pause();
  else viewer.animator.play();
}};
slider.oninput = () => seek(Number(slider.value));
const tell_time = () => {{
  if (!knots) return;
  const {{actions, playing}} = viewer.animator;
  const time = along(knots, 0, 1, Math.min(actions[0].time, knots[knots.length - 1][0]));
  toggle.textContent = playing ? "pause" : "play";
  slider.value = actions[0].time;
  clock.value = `${{Math.abs(time).toFixed(3)}} s ${{time < 0 ? "before" : "after"}} the impact`;
}};
const stay_above_ground = () => {{  // in the axes of the camera, whose y is up
  const {{controls}} = viewer, {{target, object: lens}} = controls;
  const ground = viewer.scene_tree.find(["meshcat", "ground"]).object;
  const floor = ground.getWorldPosition(target.clone()).y;
  const lift = Math.max(floor - target.y, 0), away = lens.position.distanceTo(target);
  const steepest = (floor - target.y - lift + 0.02 * away) / away;
  const most = Math.acos(Math.min(1, Math.max(-1, steepest)));
  if (lift === 0 && Math.abs(most - controls.maxPolarAngle) < 1e-9) return;
  target.y += lift;
  lens.position.y += lift;
  controls.maxPolarAngle = most;
  viewer.set_dirty();
}};
const seen = node => node.getWorldPosition(node.position.clone()).project(viewer.camera);
const place = () => {{  // each label beside its point, where it covers least
  const width = viewer.dom_element.offsetWidth, height = viewer.dom_element.offsetHeight;
  const pixel = point => [(1 + point.x) / 2 * width, (1 - point.y) / 2 * height];
  const bar = document.getElementById("time"), boxes = [], points = [], waiting = [];
  const keep_free = each => boxes.push(
    {{x: each.offsetLeft, y: each.offsetTop, w: each.offsetWidth, h: each.offsetHeight}});
  if (!below.matches) keep_free(caption);
  if (!bar.hidden) keep_free(bar);
  for (const label of document.querySelectorAll(".scene:not([hidden]) .label")) {{
    const node = viewer.scene_tree.find(label.dataset.node.split("/").slice(1)).object;
    const end = seen(node), start = seen(node.parent), is_mark = label.matches(".mark");
    const shown = node.matrixWorld.getMaxScaleOnAxis() > 0.5 && end.z < 1;  // grown, and in front
    label.style.visibility = "hidden";
    if (!shown) continue;
    const [[x, y], [x0, y0]] = [pixel(end), pixel(start)];
    for (let k = 0; k <= 16 && !is_mark; k++)  // along the arrow that ends at the point
      points.push([x0 + (x - x0) * k / 16, y0 + (y - y0) * k / 16]);
    waiting.push({{label, x, y, is_mark, back: x < x0}});
  }}
  for (const {{label, x, y, is_mark, back}} of waiting) {{
    const w = label.offsetWidth, h = label.offsetHeight, gap = 6;
    const [right, left, middle] = [x + gap, x - w - gap, x - w / 2];
    const sides = back ? [left, right] : [right, left];
    const places = is_mark ? [[middle, y - h / 2]] : [
      ...sides.map(each => [each, y - h / 2]), [middle, y - h - gap], [middle, y + gap],
      ...sides.flatMap(each => [[each, y - h - gap], [each, y + gap]]),
      ...sides.flatMap(each => [[each, y - 2 * h - gap], [each, y + h + gap]]),
    ];
    const overlap = (x, y) => boxes.filter(
      b => x < b.x + b.w && b.x < x + w && y < b.y + b.h && b.y < y + h).length;
    const cost = (x, y) => 50 * overlap(x, y)
      + 100 * (x < 0 || y < 0 || x + w > width || y + h > height)
      + (is_mark ? 0 : points.filter(([u, v]) => x < u && u < x + w && y < v && v < y + h).length);
    const costs = places.map((each, rank) => cost(...each) + 0.1 * rank);
    const least = Math.min(...costs), [u, v] = places[costs.indexOf(least)];
    if (is_mark && least >= 50) continue;
    boxes.push({{x: u, y: v, w, h}});
    label.style.visibility = "visible";
    label.style.left = `${{u}}px`;
    label.style.top = `${{v}}px`;
  }}
}};
const refresh = () => {{
  stay_above_ground();
  tell_time();
  place();
  requestAnimationFrame(refresh);
}};
document.querySelectorAll("nav button").forEach((button, number) => {{
  button.onclick = () => show(number);
}});
show(Math.min(Number(wanted.get("scene")) || 0, scenes.length - 1));
if (wanted.has("at") && knots) {{
  const [first, last] = [knots[0][1], knots[knots.length - 1][1]];
  const time = Math.min(Math.max(Number(wanted.get("at")) || 0, first), last);
  seek(along(knots, 1, 0, time));
}}
requestAnimationFrame(refresh);
</script>
</body>
</html>
"""


class Recorder:
    """The window into which a `meshcat.Visualizer` draws: it has no socket, server or process."""

    web_url = "in memory"  # the address that a `meshcat.Visualizer` reads; there is none

    def __init__(self) -> None:
        """Start without commands, labels and warnings."""
        self.commands: list[bytes] = []  # packed, in order
        self.labels: list[str] = []  # HTML
        self.warnings: list[str] = []  # of what could not be drawn, plain text

    def send(self, command: Any) -> None:
        """Record a meshcat command, equal to the bytes of another that does the same."""
        self.commands.append(umsgpack.packb(_renumbered(command.lower(), {})))


def _renumbered(value: Any, known: dict[str, str]) -> Any:
    """Return a command with numbers, in order, for the random identifiers of its objects."""
    if isinstance(value, list):
        return [_renumbered(each, known) for each in value]
    if not isinstance(value, dict):
        return value
    return {
        key: known.setdefault(each, f"{len(known)}")
        if key in IDENTIFIERS and isinstance(each, str)
        else _renumbered(each, known)
        for key, each in value.items()
    }


IDENTIFIERS = ("uuid", "geometry", "material")
"""Keys of three.js's objects under which an identifier stands."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A scene as a page shows it.

    Attributes:
        viewer: the `meshcat.Visualizer` of `recording_viewer` into which the scene is drawn.
        panel: HTML beside it.
        times: of the animation, and of the kick that it shows then, shape `(n, 2)` [s]; the kick's
            time is linear in between. None where nothing moves.
    """

    viewer: Any
    panel: str
    times: Array | None = None


def recording_viewer() -> Any:
    """Return a `meshcat.Visualizer` that draws into memory: its `window` is a `Recorder`."""
    return meshcat.Visualizer(window=Recorder())


def draw_label(viewer: Any, text: str, colour: str, point: Array) -> None:
    """Draw a plain text beside a point, shape `(3,)` [m], in a frame of a colour of CSS.

    `viewer` is the label's node, whose parent's origin is the start of the arrow to that point.
    """
    viewer.set_transform(tf.translation_matrix(point))
    viewer.window.labels.append(
        f'<div class="label" data-node="{viewer.path.lower()}" style="border-color: {colour}">'
        f"{escape(text)}</div>"
    )


def draw_mark(viewer: Any, text: str, point: Array) -> None:
    """Draw a plain text at a point, shape `(3,)` [m], where no other text is in its place."""
    viewer.set_transform(tf.translation_matrix(point))
    viewer.window.labels.append(
        f'<div class="label mark" data-node="{viewer.path.lower()}">{escape(text)}</div>'
    )


def html_document(title: str, recordings: Mapping[str, Recording]) -> str:
    """Return a page with a title in plain text that shows the first of some scenes.

    Of several, there is a button for each, with its name in plain text.
    """
    numbers: dict[bytes, int] = {}  # of commands, each of which is on the page once
    scenes, labels, panels = [], [], []
    for each, one in enumerate(recordings.values()):
        window = one.viewer.window
        scenes.append({
            "commands": [numbers.setdefault(c, len(numbers)) for c in window.commands],
            "times": None if one.times is None else one.times.tolist(),
        })  # fmt: skip
        texts = "\n".join(window.labels)
        labels.append(f'<div class="labels scene" data-scene="{each}">\n{texts}\n</div>')
        panels.append(f'<section class="scene" data-scene="{each}">\n{one.panel}</section>')
    buttons = "".join(f"<button>{escape(name)}</button>\n" for name in recordings)
    return _PAGE.format(
        policy=_POLICY,
        title=escape(title),
        style=_STYLE,
        labels="\n".join(labels),
        buttons=f"<nav>\n{buttons}</nav>\n" if len(recordings) > 1 else "",
        panels="\n".join(panels),
        engine=_engine(),
        commands=",\n".join(f'"{base64.b64encode(each).decode()}"' for each in numbers),
        scenes=json.dumps(scenes),
        left=LEFT / UP,
        right=RIGHT / UP,
        spread=1.1 * (LEFT + RIGHT) / (2 * UP),
        aside=(RIGHT - LEFT) / 2,
    )


@cache
def _engine() -> str:
    """Return the JavaScript of meshcat's viewer, three.js included."""
    return (files("meshcat") / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")
