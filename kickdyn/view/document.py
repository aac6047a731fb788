"""A meshcat scene in memory, and the HTML that shows it: one file that needs no network.

meshcat's own controls are hidden; `#controls` at the end of the page's address shows them, and
`#at=1.5` stops its animation at 1.5 s.
"""

import base64
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
body { margin: 0; font: 14px/1.45 system-ui, "Segoe UI", Roboto, Helvetica, Arial, sans-serif; }
#meshcat-pane { position: relative; width: 100vw; height: 100vh; overflow: hidden; }
.dg.main { display: none; }
#controls:target ~ .dg.main { display: block; }
#caption {
  position: absolute; top: 14px; left: 14px; max-width: 300px; max-height: calc(100vh - 60px);
  box-sizing: border-box; overflow: auto; padding: 12px 16px; border-radius: 8px;
  background: rgba(255, 255, 255, 0.88); color: #1d2733; box-shadow: 0 1px 6px rgba(0, 0, 0, 0.2);
}
#caption h1 { margin: 0 0 6px; font-size: 16px; overflow-wrap: anywhere; }
#caption p { margin: 0 0 6px; overflow-wrap: anywhere; }
#caption .warning { color: #a33a00; }
#caption table { border-spacing: 0; }
#caption th, #caption td { padding: 1px 0; text-align: left; vertical-align: top; }
#caption th { padding-right: 12px; white-space: nowrap; font-weight: normal; color: #5b6774; }
#caption td { font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
#caption details { margin-top: 4px; }
#caption summary { cursor: pointer; color: #5b6774; }
#caption details th { white-space: normal; }
#caption details td { white-space: nowrap; }
#caption .key { display: inline-block; width: 10px; height: 10px; border-radius: 2px; }
.label {
  position: absolute; left: 0; top: 0; padding: 0 6px; border: 2px solid; border-radius: 5px;
  font-size: 13px; white-space: nowrap; pointer-events: none; visibility: hidden;
  background: rgba(255, 255, 255, 0.88); color: #1d2733;
}
@media (max-width: 1000px) {  /* a notebook's frame or a telephone has no space beside the leg */
  #meshcat-pane { height: 66vh; }
  #caption {
    position: static; max-width: none; height: 34vh; max-height: none; padding: 8px 14px;
    border-radius: 0; box-shadow: none; font-size: 12px;
  }
  #caption h1 { font-size: 14px; margin: 0 0 2px; }
  #caption table, #caption tbody { display: block; }
  #caption tbody {
    display: grid; grid-template-columns: repeat(auto-fill, minmax(160px, 1fr)); column-gap: 20px;
  }
  #caption tr { display: flex; }
  #caption tr.long { grid-column: 1 / -1; }
  #caption th { flex: 0 0 auto; }
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
</div>
{panel}
<script>{engine}</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
const resize = viewer.set_3d_pane_size.bind(viewer);  // to the window's height, not the pane's
const below = matchMedia("(max-width: 1000px)");  // the caption is not over the scene
viewer.set_3d_pane_size = () => {{
  const width = viewer.dom_element.offsetWidth, height = viewer.dom_element.offsetHeight;
  const lens = viewer.camera, beside = (width - 2 * {panel_width}) / {left};
  const extent = below.matches ? width / {spread} : Math.min(width / {right}, beside);
  lens.zoom = Math.min(1, extent / height);  // show all that the camera was set for
  lens.aspect = width / height;
  lens.filmOffset = below.matches ? {aside} * lens.getFilmWidth() : 0;
  resize(width, height);
}};
// In order and at once; meshcat's own export fetches each command on its own, in any order.
for (const command of [
{commands}
]) {{
  viewer.handle_command_bytearray(Uint8Array.from(atob(command), c => c.charCodeAt(0)));
}}
const seen = node => node.getWorldPosition(node.position.clone()).project(viewer.camera);
const caption = document.getElementById("caption");
const place = () => {{  // each label beside its point, ahead of an arrow that ends there
  const width = viewer.dom_element.offsetWidth, height = viewer.dom_element.offsetHeight;
  const placed = [];
  for (const label of document.querySelectorAll(".label")) {{
    const node = viewer.scene_tree.find(label.dataset.node.split("/").slice(1)).object;
    const w = label.offsetWidth, h = label.offsetHeight;
    const end = seen(node), start = seen(node.parent);
    const shown = node.matrixWorld.getMaxScaleOnAxis() > 0.5 && end.z < 1;  // grown, and in front
    label.style.visibility = shown ? "visible" : "hidden";
    if (!shown) continue;
    const right = (1 + end.x) / 2 * width + 6, left = right - w - 12;
    let y = (1 - end.y) / 2 * height - h / 2, other;
    const covered = !below.matches && left < caption.offsetLeft + caption.offsetWidth
      && y < caption.offsetTop + caption.offsetHeight;
    const x = right + w > width || (end.x < start.x && !covered) ? left : right;
    while (other = placed.find(p => x < p.x + p.w && p.x < x + w && Math.abs(y - p.y) < h))
      y = other.y + (end.y < start.y ? h : -h);
    placed.push({{x, y, w}});
    label.style.left = `${{x}}px`;
    label.style.top = `${{y}}px`;
  }}
  requestAnimationFrame(place);
}};
requestAnimationFrame(place);
const at = /^#at=([0-9.]+)$/.exec(location.hash);
if (at) {{
  viewer.animator.pause();
  viewer.animator.seek(Number(at[1]));
}}
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
        """Record a meshcat command."""
        self.commands.append(umsgpack.packb(command.lower()))


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


def html_document(viewer: Any, title: str, panel: str) -> str:
    """Return a page that contains a recorded scene, a title in plain text, and a panel of HTML."""
    commands = (f'"{base64.b64encode(each).decode()}"' for each in viewer.window.commands)
    return _PAGE.format(
        policy=_POLICY,
        title=escape(title),
        style=_STYLE,
        labels="\n".join(viewer.window.labels),
        panel=panel,
        engine=_engine(),
        commands=",\n".join(commands),
        panel_width=316,
        left=LEFT / UP,
        right=RIGHT / UP,
        spread=1.1 * (LEFT + RIGHT) / (2 * UP),
        aside=(RIGHT - LEFT) / 2,
    )


@cache
def _engine() -> str:
    """Return the JavaScript of meshcat's viewer, three.js included."""
    return (files("meshcat") / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")
