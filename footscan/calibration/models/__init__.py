"""Models from pixels to the laser plane: fit and selection."""
