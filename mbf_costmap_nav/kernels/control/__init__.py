"""Compiled rollouts and critics of the sampling controllers, and path smoothing."""
