"""Meshes of other scanners, prepared: unit, orientation, the floor, soles that were not seen, ends that are missing."""
