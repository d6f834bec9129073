"""How fast a foot sways."""

PACE_FRAMES = 4.5
"""Standard deviation of a slow movement relative to that of its slope by frame: 4.5 for one of 0.2 to 1 Hz (D. A.
Winter, Gait & Posture 3(4), 1995) at 18 frames a second."""
PACES_BETWEEN = 1.6
"""Distance in frames between independent errors, relative to the pace of the movement that is interpolated linearly
between them (`ErrorField`, scaled to one standard deviation throughout). From 500 such movements, drawn at random."""
