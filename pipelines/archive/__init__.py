"""An archive of recorded scans: its workflow, its jobs, and the table and page of their results."""
