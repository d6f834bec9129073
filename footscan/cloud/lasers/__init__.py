"""Which of several lasers made each stripe point, and the moment at which a camera saw it."""
