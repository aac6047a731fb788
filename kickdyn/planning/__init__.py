"""From a goal back to the launch, and the kick that meet it.

Open `kick.py` first: `plan_kick` goes through the whole method.
"""
