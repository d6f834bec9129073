"""Calibration from films of the reference object."""
