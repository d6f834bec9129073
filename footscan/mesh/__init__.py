"""Triangle meshes, their files, sections and samples, and grids of points."""
