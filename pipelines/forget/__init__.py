"""Forgetting a patient: finding all that is theirs, erasing it, and proving that nothing is left."""
