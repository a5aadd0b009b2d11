"""Compiled inner loops: pure functions, arrays in, arrays out. Importing them compiles nothing."""
