"""What shoes a foot takes: sizes, widths, pairs, change over time, lasts."""
