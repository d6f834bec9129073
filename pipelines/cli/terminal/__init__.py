"""Output of the command, and the progress of a run."""
