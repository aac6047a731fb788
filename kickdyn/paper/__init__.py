"""The ICRA 2005 paper's tables and figures, reproduced item by item, a module for each.

Open `reproduce.py` first, the list of all items and their table; `item.py` says what an item and
its verdict are.
"""
