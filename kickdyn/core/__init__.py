"""Validation, representation in terminal and Jupyter, files, tables, plots and compiled code.

Open `validation.py` first: every public function checks its input with it.
"""
