"""Films in, Zarr out: camera bytes kept as they came."""
