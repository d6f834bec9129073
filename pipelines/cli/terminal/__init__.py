"""What the command prints, and how far a run is."""
