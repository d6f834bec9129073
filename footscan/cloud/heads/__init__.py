"""Where the heads are along the travel, from the skin that cameras of two heads see in a scan."""
