"""File access of the engine: atomic writes, digests, seals, and stores in a folder or at a URL."""
