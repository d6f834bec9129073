"""The scanner itself: heads and lasers over a serial line, cameras, and the clocks that bring them together."""
