"""Controller plugins for meshes."""
