"""Triangle meshes and grids, as several rooms need them."""
