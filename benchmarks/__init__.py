"""What the parts cost and how good they are, beside a named baseline in the same run."""
