"""Experiments that compare executives; no part of the library."""
