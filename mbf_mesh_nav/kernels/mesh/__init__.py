"""Compiled geometry of triangle meshes: topology, box trees, rays, walks on the surface."""
