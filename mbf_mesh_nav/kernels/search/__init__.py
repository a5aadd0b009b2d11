"""Compiled searches over the vertex graph."""
