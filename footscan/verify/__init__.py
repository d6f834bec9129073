"""Registration to a reference, distances from it, and fits of reference bodies."""
