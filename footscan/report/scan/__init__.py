"""The page of one scan."""
