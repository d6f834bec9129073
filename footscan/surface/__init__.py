"""Cloud to mesh; export."""
