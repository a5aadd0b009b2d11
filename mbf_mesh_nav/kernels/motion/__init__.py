"""Compiled rollouts on the surface, poses and costs along paths."""
