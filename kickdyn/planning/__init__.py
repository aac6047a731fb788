"""From a goal back to the launch, the kick and the swing that meet it.

Open `kick.py` first: `plan_kick` goes through the whole method.
"""
