"""Measured accuracy, for `kickdyn tradeoff`: error against cost, and effects of a scene.

Open `measurement.py` first; `references/` has what kickdyn is compared with.
"""
