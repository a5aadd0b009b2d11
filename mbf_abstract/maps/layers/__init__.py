"""Layers of a map, whatever the map: their base, their list in the configuration, their order, their freshness."""
