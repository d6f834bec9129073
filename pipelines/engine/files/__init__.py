"""Files as the engine reads and writes them: whole, by their digests, in a folder or at a URL."""
