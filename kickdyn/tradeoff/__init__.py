"""Error against cost of methods for impact and flight, and plots of what each effect changes.

Open `measurement.py` first; `impact_methods.py` and `flight_methods.py` define the methods.
"""
