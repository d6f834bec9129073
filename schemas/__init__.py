"""The contracts: every file that outlives a run, as a versioned model. Imports neither `footscan` nor `pipelines`."""
