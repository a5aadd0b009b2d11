"""Compiled loops of the mesh layers."""
