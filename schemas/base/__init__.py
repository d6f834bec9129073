"""What all schemas are made of: documents and their errors, limits, units."""
