"""Compiled loops over cells: pure functions, arrays in, arrays out."""
