"""The frame of a foot: how it stands, and its axis."""
