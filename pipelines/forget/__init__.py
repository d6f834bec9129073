"""Erasure of a patient's data: find it, erase it, and prove that nothing is left."""
