"""Stripe points to world points, removal of outliers, normals, colours; fusion of the cameras."""
