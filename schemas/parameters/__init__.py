"""What a step can be told: one model a step, each value with its unit and its range."""
