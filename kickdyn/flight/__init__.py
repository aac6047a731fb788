"""Everything after the impact: where the ball goes."""
