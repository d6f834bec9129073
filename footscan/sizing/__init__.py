"""Sizes and widths of shoes for a foot; pairs of feet, change over time, lasts."""
