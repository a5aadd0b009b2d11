"""Controllers that are the same on every map."""
