"""Robots that a URDF describes, in scenarios and in the simulated worlds."""
