"""What refiners of every map have in common."""
