"""Where the laser planes lie along the travel, from a film of a body whose form shows it."""
