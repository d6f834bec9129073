"""The USB cameras: their places on USB, their streams, and the times of their frames."""
