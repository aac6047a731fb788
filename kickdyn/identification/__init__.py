"""From measured positions of a ball to its launch, spin, drag and bounces.

Open `identify.py` first: it fits the equations of flight to a track.
"""
