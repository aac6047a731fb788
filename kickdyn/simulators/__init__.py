"""Contacts of simulators, fitted so that simulated kicks agree with kickdyn's.

Open `tune_mujoco.py` first; `mujoco_kick.py` simulates a kick in MuJoCo.
"""
