"""Recorded scans: finding them in an archive, and checking what their scan.yaml promises."""
