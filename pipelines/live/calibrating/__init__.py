"""Calibrating and checking the scanner by the scanner itself, step by step."""
