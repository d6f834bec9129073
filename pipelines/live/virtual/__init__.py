"""A virtual scanner in place of the real one."""
