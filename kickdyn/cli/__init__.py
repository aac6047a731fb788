"""The command lines: they parse options, call the packages below, and print or write the answer.

Open `commands.py` first, the table of all, which says how each of them ends.
"""
