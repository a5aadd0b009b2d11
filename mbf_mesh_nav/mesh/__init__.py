"""A triangle mesh as a surface: checks, repairs, topology, and exact location queries."""
