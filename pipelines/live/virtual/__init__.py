"""A virtual scanner without hardware."""
