"""Recovery plugins for meshes."""
