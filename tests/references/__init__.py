"""Impacts and flights with 20 to 50 digits by mpmath, which tests and benchmarks compare with."""
