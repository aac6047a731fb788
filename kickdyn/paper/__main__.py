"""Run the paper's door."""

from kickdyn.door import enter

enter("paper", "kickdyn.paper.command", "paper")
