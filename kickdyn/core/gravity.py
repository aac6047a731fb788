"""Gravity, the same for flights, joint torques and models of legs."""

GRAVITY = 9.81
"""Acceleration along -z of the world frame [m/s2], as in Table 3 of the paper."""
