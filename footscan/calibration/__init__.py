"""Control points in, a pixel-to-world model out."""
