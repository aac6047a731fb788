"""Measured accuracy: error against cost, effects of a scene, and answers at the extremes.

Open `measurement.py` first; `references/` has what kickdyn is compared with.
"""
