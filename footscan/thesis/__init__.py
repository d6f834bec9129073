"""The thesis that built the first such scanner: its printed data, what its method makes of them, and its mistakes."""
