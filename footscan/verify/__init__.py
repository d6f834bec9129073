"""Registration and distances against a reference."""
