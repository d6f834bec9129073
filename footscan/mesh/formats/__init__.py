"""Files of meshes and clouds, one module a format. `footscan.mesh.formats.files` chooses by a file's name."""
