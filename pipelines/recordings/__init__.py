"""Captures of a scanner and its calibrations: finding them, and choosing the one of a scan."""
