"""Coefficients of drag, lift and spin decay, each a function with its range and its source.

Open `drag.py` first: a new model is one function and one entry in `MODELS` at the end of its file.
"""

# so that all models are registered whenever one is unpickled
from kickdyn.aerodynamics import drag, lift, spin_decay

__all__ = ["drag", "lift", "spin_decay"]
