"""Codes of cells: their costs as in costmap_2d, and their states as in ``maps.queries.CellState``."""

FREE, INSCRIBED, LETHAL, UNKNOWN = 0, 253, 254, 255
"""Costs; those above FREE and below INSCRIBED grow towards obstacles."""
FREE_STATE, INSCRIBED_STATE, LETHAL_STATE, UNKNOWN_STATE, OUTSIDE_STATE = range(5)
