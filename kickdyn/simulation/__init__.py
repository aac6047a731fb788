"""A scene answered to a tolerance: what cannot matter is left out, with a bound on its worth."""
