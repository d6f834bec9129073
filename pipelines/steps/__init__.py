"""One module a step: bytes in, bytes out, the science called in between."""
