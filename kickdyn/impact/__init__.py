"""The instant when the foot hits the ball: impulses on the ball and in the leg, motion just after.

Open `strike.py` first: it is the method in a few lines, from a posture to an `Impact`. What an
impact law sees is in `contact_problem.py`. A contact that takes time begins in `collide.py`.
"""
