"""Contacts of MuJoCo, fitted so that simulated kicks agree with kickdyn's, and motions run in it.

Open `tune_mujoco.py` first; `run_in_mujoco.py` carries a planned motion out.
"""
