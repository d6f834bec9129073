"""The page that compares a shape with a reference."""
