"""A parametric foot with known measures."""
