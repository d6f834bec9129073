"""Two calibrations side by side, and the drift since the last one."""
