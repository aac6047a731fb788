"""Robots: a leg with its contact frame, its postures, supports and loops, and file readers."""
