"""The virtual scanner: a mesh in, films out. Shares the project's formats with the reconstruction, nothing else."""
