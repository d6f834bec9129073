"""Calibration from a chart of control points that a person has measured."""
