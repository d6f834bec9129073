"""What a night found, its page and its JUnit file."""
