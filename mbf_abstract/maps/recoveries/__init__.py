"""Recovery behaviours that are the same on every map."""
