"""A kick as a whole: leg, posture, ball, contact, air, ground and plane, read from a TOML file."""
