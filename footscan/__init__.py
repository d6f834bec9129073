"""The science: arrays in, arrays out. Knows nothing of Dask, of the cache or of the command line."""
