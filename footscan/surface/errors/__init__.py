"""Errors of the surface of a scan: standard deviations of its vertices, one field a cause."""
