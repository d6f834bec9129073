"""The report of every morning: whether last night's code still measures the same feet."""
