"""kickdyn at the extremes: every answer is right, as exact as it claims, or refused.

Run it with `python tests/extremes`; open `extreme_case.py` first.
"""
