"""The motion of a kick, from rest through the impact to rest.

Open `motion.py` first: the result. `plan_motion.py` plans it: a `KickTask` with its `limits.py`
makes a `MotionProblem`, each of whose `Solution`s a `Verdict` checks between the solver's points.
"""
