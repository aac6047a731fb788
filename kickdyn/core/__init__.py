"""Validation, read-only arrays, text and HTML representation, writing files."""
