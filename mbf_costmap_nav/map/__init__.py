"""The layered costmap that a server runs: layers, sensor data, queries, life cycle."""
