"""What the table of an archive answers: rows, statistics and a page of points."""
