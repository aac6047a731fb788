"""Validation, gravity, vectors, text and HTML representation, files, tables, plots, compiled code.

Open `validation.py` first: every public function checks its input with it.
"""
