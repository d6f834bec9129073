"""The motion controller: Grbl over a serial line, heads, lasers and the ways to stop them."""
