"""A running simulation: world, robot and server wired on one clock, and the executives that drive it."""
