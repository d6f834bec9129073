"""What stands and shines around the scanner."""
