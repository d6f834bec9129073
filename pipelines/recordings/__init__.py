"""Recorded scans and captures: finding them, and checking what their documents promise."""
