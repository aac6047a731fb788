"""Aerodynamic coefficients of a ball: plug-in models, each with its range and its source."""
