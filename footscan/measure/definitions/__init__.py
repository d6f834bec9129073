"""Which published definitions the measures follow."""
