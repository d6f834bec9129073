"""A virtual motion controller that speaks Grbl."""
