"""Models from pixels to the plane of the laser: fitting them and choosing between them."""
