"""Plain ways to find a stripe, for comparison."""
