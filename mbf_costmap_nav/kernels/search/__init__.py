"""Compiled searches on grids: Dijkstra, A*, Theta*."""
