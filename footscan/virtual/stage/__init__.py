"""Objects on the glass: a foot, the reference object, a block."""
