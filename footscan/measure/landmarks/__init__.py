"""Landmarks of the foot, by the part of the foot on which they lie."""
