"""Bodies of which a part was not seen or is not there, and meshes that hold more than one foot."""
