"""Compiled loops of the layers and of footprint checks."""
