"""`footscan calibrate`."""
