"""Codes of cells: their costs as in costmap_2d, and their states and fits as in ``maps.queries``."""

FREE, INSCRIBED, LETHAL, UNKNOWN = 0, 253, 254, 255
"""Costs; those above FREE and below INSCRIBED grow towards obstacles."""
FREE_STATE, INSCRIBED_STATE, LETHAL_STATE, UNKNOWN_STATE, OUTSIDE_STATE = range(5)
TOUCHES_FIT, FREE_FIT = 0, 2
