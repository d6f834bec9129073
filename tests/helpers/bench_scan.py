"""The recorded scan that all end-to-end tests share."""

FRAMES, STEP_MM = 36, 8.0
"""As coarse as a foot can be measured from: what these tests look at does not depend on the number of frames."""
