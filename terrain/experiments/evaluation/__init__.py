"""The evaluations of ``mbf bench``: a planner or controller through the worlds that the shipped ones went through.

A protocol is frozen: its worlds, robot, configurations, seeds and judge have a version and a hash, and results compare
only where the hash is the same. What shall change is a new version, beside the old one.
"""
