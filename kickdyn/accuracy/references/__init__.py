"""Independent references, which only tests, benchmarks and `kickdyn tradeoff` use.

Open `exact_impact.py` first. Impacts and flights with 20 to 50 digits need mpmath
(`pip install "kickdyn[accuracy]"`); MuJoCo and heyoka are used where they are installed.
"""
