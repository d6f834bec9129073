"""Bodies of known shape fitted to points: boxes and spheres."""
