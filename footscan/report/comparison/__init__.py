"""The page that holds a shape beside a reference."""
