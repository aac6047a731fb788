"""Measured accuracy, for `kickdyn tradeoff`: error against cost, and effects of a scene.

Open `measurement.py` first; `impact_methods.py` and `flight_methods.py` say what is compared.
"""
