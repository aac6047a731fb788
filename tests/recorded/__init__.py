"""What kickdyn answers today, stored, so that no change of an answer goes unseen.

`cases_*.py` name what is computed, `plain.py` turns an answer into numbers and text, `differences.py`
compares two of them, and `expected/` has what `python tools/record.py` stored. These tests prove
nothing about physics.
"""
