"""A step, the identity of its code, and the key of an action."""
