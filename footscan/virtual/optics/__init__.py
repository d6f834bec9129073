"""Light from the laser to the sensor: rays, glass, lens, surfaces, noise."""
