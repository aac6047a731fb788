"""Measured accuracy: error against cost, effects of a scene, and contacts for MuJoCo.

Open `measurement.py` first; `impact_methods.py` and `flight_methods.py` say what is compared.
`tune_mujoco.py` fits simulated kicks to kickdyn's.
"""
