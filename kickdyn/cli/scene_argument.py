"""The scenes that command lines name."""

from collections.abc import Callable
from typing import Any, TypeVar

import click

from kickdyn.cli.command import offers
from kickdyn.core.files import shipped

Command = TypeVar("Command", bound=Callable[..., Any])


def scene_names(_: click.Context) -> list[str]:
    """Return the names of the scenes that come with kickdyn."""
    return sorted(scene.stem for scene in shipped("scenes").glob("*.toml"))


scene_argument: Callable[[Command], Command] = click.argument(
    "scene_file", metavar="SCENE", shell_complete=offers(scene_names, files=True)
)
"""Gives a command the argument `scene_file`."""
