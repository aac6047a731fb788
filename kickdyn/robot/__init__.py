"""A leg or robot with its contact frame, its postures, supports and loops, and file readers.

Open `leg.py` first: it has `Leg` and `Posture`; the other files are what these two are made of.
"""
