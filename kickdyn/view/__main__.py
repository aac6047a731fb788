"""Run the view's door."""

from kickdyn.door import run
from kickdyn.view.command import view

run(view)
