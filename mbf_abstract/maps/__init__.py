"""The contract of navigation maps, and everything about maps that is the same on every backend."""
