"""Pictures of a chessboard in, calibrations out: pinhole with distortion, and the laser plane, after Zhang (2000)."""
