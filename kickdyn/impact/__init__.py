"""The instant of contact: impulse on the ball, impulses inside the leg, motion just after."""
