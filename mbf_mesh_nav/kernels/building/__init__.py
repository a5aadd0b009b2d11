"""Compiled steps from a point cloud to a mesh."""
