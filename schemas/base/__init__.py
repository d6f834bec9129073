"""The parts that all schemas share: documents and their errors, limits, units."""
