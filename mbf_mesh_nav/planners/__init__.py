"""Planner plugins for meshes."""
