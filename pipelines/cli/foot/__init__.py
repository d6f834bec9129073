"""Commands on a foot that was measured."""
