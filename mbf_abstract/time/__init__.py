"""Clocks of the wall and of a simulation, cancel tokens, and tasks at a fixed rate."""
