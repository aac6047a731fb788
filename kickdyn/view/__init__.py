"""3-D pages of kicks and flights, drawn with meshcat.

Open `page.py` first: `kickdyn.page` shows the results of every computation.
"""
