"""kickdyn at the extremes: `python tests/extremes`; open `extreme_case.py` first."""
