"""Files of meshes and clouds, a module a format. `footscan.surface.export` chooses by a file's name."""
