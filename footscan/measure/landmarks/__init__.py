"""Landmarks of the foot, by the part of the foot where they lie."""
