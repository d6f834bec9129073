"""The parameters of the steps: one model a step, each value with its unit and its range."""
