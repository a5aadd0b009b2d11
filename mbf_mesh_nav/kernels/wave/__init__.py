"""Compiled continuous wave over faces: propagation, descent and string pulling."""
