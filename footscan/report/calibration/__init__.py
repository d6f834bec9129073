"""Figures of a calibration and of the capture behind it."""
