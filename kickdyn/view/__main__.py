"""Run the view's door."""

from kickdyn.door import enter

enter("view", "kickdyn.view.command", "view")
