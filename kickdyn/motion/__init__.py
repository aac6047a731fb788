"""The motion of a kick, from rest through the impact to rest.

Open `motion.py` first: the result.
"""
