"""Building tiled maps: what they are cut from, with what settings, and by which processes."""
