"""Landmarks, lengths, girths, sizes."""
