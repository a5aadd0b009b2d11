"""Meshes and elevation models on disk."""
