"""Comparison of two calibrations, and the drift of a camera since the last one."""
