"""The costs of the layers that no sensor writes, kept until something other than a sensor changes the map."""

from __future__ import annotations

from collections.abc import Sequence

from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.cell_window import CellWindow
from mbf_costmap_nav.map.layer import CostmapLayer


class PermanentLayers:
    """Not thread-safe: used under the lock of the costmap."""

    def __init__(self) -> None:
        self._costmap: Costmap | None = None
        self._renewals = -1

    def forget(self) -> None:
        """Compute the costs anew when they are asked for next."""
        self._renewals = -1

    def costmap(self, layers: Sequence[CostmapLayer], window: CellWindow, stamp: float) -> Costmap | None:
        """Costs of the permanent ones of some layers; None without any, and where another one may lower their costs.

        The same object as long as the window is not renewed as a whole: by parameters, outline, a clearing, a floor.
        """
        if self._renewals != window.renewals:
            self._costmap = _computed(layers, window, stamp)
            self._renewals = window.renewals
        return self._costmap


def _computed(layers: Sequence[CostmapLayer], window: CellWindow, stamp: float) -> Costmap | None:
    permanent = [layer for layer in layers if layer.permanent]
    if not permanent or not all(layer.permanent or layer.only_raises for layer in layers):
        return None
    window.compute_all()  # layers may keep notes of the cells they are asked for
    cells = window.default_cells()
    for layer in permanent:
        layer.update_costs(cells, window.geometry.box)
    cells.flags.writeable = False
    return window.costmap(cells, stamp)
