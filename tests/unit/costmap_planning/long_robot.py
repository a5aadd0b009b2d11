"""A robot longer than wide among lethal boxes, for the tests of what it does in tight places."""

import numpy as np

from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint

LONG_ROBOT = Footprint([[-0.43, -0.33], [0.43, -0.33], [0.43, 0.33], [-0.43, 0.33]])
RESOLUTION = 0.05  # m


def walled(*boxes):
    """A map of 10 m x 10 m about the origin with lethal boxes (x from, to, y from, to) [m]."""
    cells = np.zeros((200, 200), dtype=np.uint8)
    for x0, x1, y0, y1 in boxes:
        columns, rows = (slice(*(round((end + 5.0) / RESOLUTION) for end in ends)) for ends in ((x0, x1), (y0, y1)))
        cells[rows, columns] = 254
    return Costmap(cells, RESOLUTION, -5.0, -5.0)
