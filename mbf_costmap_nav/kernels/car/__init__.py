"""Compiled search of Hybrid A* and the curves of a car."""
