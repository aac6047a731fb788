"""The door to the pictures: `kickdyn view`."""

from __future__ import annotations

import click

from kickdyn.cli.command import busy
from kickdyn.core import validation
from kickdyn.core.files import check_outputs, write_json
from kickdyn.errors import InvalidInput
from kickdyn.impact.impact_result import Impact
from kickdyn.scene.simulate import simulate_as_instant
from kickdyn.scene.toml_reader import load_scene
from kickdyn.view.playback import pace_of, shown_at
from kickdyn.view.screenshot import check_photo, save_photo


@click.command("view", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("scene_file", metavar="SCENE")
@click.option("--out", metavar="FILE.html", help="Write the 3-D page.")
@click.option("--png", metavar="FILE.png", help="Write a picture of the page, by Chromium.")
@click.option("--at", default=0.0, show_default=True,
              help="What the picture shows: so long after the impact [s].")  # fmt: skip
@click.option("--json", "json_file", metavar="FILE", help="Write the numbers; - is stdout.")
def view(
    scene_file: str, out: str | None, png: str | None, at: float, json_file: str | None
) -> None:
    """Show a scene file: leg, ball, impulses, flight, and the wall or goal it names.

    SCENE is a TOML file, or the name of one that comes with kickdyn: free_kick, paper_kick,
    robocup_carpet, robot_chip, volley, wet_grass_pass.

    All it names is modelled; but a contact that takes time is shown as an instant, and the error
    says how far off that ends.

    Example: kickdyn view free_kick --out kick.html --png kick.png
    """
    if out is None and png is None and json_file is None:
        raise InvalidInput("nothing is to be written: name --out, --png or --json")
    validation.number("at", at, at_least=0, unit="s")
    check_outputs(out, png, json_file=json_file)
    if png is not None:
        check_photo(png)
    # rich takes a tenth of a second, meshcat half of one: other commands shall not wait for them
    from kickdyn.core.console import screen_width, wrapped
    from kickdyn.view.kick_page import write_page
    from kickdyn.view.scene_page import numbers, scene_page

    scene = load_scene(scene_file)
    with busy("simulating") as say:
        answer = simulate_as_instant(scene)
        if out is not None or png is not None:
            say("drawing the page")
            html = scene_page(answer)
            if out is not None:
                write_page(out, html)
            if png is not None:
                assert isinstance(answer.impact, Impact)
                pace = pace_of(answer.impact, float(answer.end.time))
                say("taking the picture")
                save_photo(html, png, shown_at(pace, at))
    if json_file is not None:
        write_json(json_file, numbers(answer))
        if json_file == "-":
            return
    width = screen_width()
    click.echo("\n".join(wrapped(line, width, indent=8) for line in str(answer).splitlines()))
    for file in (out, png, json_file):
        if file is not None:
            click.echo(f"wrote {file}")
