"""The pages of the console, and their content."""
