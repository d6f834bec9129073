"""Files of meshes and clouds, one module per format. `footscan.mesh.formats.files` chooses by the file name."""
