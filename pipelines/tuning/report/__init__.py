"""What a search for parameters found, and its page."""
