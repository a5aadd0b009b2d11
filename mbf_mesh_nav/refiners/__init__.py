"""Refiners on triangle meshes."""
