"""Stripe points to world points; fusion of the cameras; outliers."""
