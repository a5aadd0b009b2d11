"""Compiled parts of what is the same on all maps: pure functions, arrays in, arrays out."""
