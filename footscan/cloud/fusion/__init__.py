"""The clouds of all cameras merged into one, after small corrections of each camera."""
