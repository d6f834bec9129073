"""The USB cameras: where they are, their streams, and the times of their frames."""
