"""How fast a foot sways."""

PACE_FRAMES = 4.5
"""Standard deviation of a slow movement relative to that of its slope by frame: 4.5 for one of 0.2 to 1 Hz (D. A.
Winter, Gait & Posture 3(4), 1995) at 18 frames a second."""
FRAMES_BETWEEN = 1.6 * PACE_FRAMES
"""Frames between independent movements, with straight lines between them and one standard deviation throughout, that
have this pace: 1.6 by 500 such movements, drawn at random."""
