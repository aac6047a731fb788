"""Analyse the kicking postures of a leg: `python -m kickdyn.posture_sweep`."""

from kickdyn.cli.commands import run
from kickdyn.cli.posture_sweep_command import posture_sweep

if __name__ == "__main__":
    run(posture_sweep)
