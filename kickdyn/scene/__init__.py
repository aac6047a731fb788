"""A whole kick as data: a `Scene`, read from TOML or made in Python, and its simulation.

Open `simulate.py` first: its top function is the method in a few lines.
"""
