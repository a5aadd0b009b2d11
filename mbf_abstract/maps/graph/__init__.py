"""A map that is a graph of places on the ground, for backends of a round robot: map, planner and server."""
