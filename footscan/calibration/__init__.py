"""Calibration of the cameras: control points or films of the reference object in, a pixel-to-world model out."""
