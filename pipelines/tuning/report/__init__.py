"""Results of a search for parameters, and their page."""
