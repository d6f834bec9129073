"""Commands on an archive and its store."""
