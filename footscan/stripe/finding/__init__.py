"""Other ways to find a stripe than by its ridges."""
