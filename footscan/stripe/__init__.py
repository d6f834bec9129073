"""A frame in, sub-pixel stripe points out."""
