"""The findings of a night: its page and its JUnit file."""
