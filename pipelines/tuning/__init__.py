"""The search for better parameters: trials, objectives, results."""
