"""Layers that join the values of several others."""
