"""Independent references, which only tests, `kickdyn tradeoff` and `kickdyn extremes` use.

Open `exact_impact.py` first. Impacts, coefficients and flights with 20 to 50 digits need mpmath
(`pip install "kickdyn[accuracy]"`); MuJoCo and heyoka are used where they are installed.
"""
