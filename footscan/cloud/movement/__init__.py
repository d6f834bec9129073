"""Movement of the foot while it is filmed, from what all stripes of a frame have in common."""
