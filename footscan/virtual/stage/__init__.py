"""What the heads travel along: a foot, the reference object, a block."""
