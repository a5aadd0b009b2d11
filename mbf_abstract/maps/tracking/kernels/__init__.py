"""Compiled parts of the tracker: pure functions, arrays in, arrays out."""
