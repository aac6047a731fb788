"""Run the paper's door."""

from kickdyn.door import run
from kickdyn.paper.command import paper

run(paper)
