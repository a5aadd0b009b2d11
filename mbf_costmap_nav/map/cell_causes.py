"""What the layers of a costmap close cells by: the layer that does, and what stands there apart from drawn areas."""

from __future__ import annotations

from collections.abc import Iterable

from mbf_costmap_nav.grid.costmap import LETHAL, CellArray, CellBox, Costmap
from mbf_costmap_nav.map.layer import CostmapLayer
from mbf_costmap_nav.map.layer_answers import LayerAnswers


class CellCauses(LayerAnswers):
    """The part of a ``LayeredCostmap`` that computes single layers anew, under its lock."""

    def lethal_reason(self, x: float, y: float) -> str:
        """Name of the layer that makes the cell at (x, y) [m] lethal, with what it says of it; empty if none does."""
        with self._lock:
            cell = self.geometry.world_to_cell(x, y)
            if cell is None:
                return ""
            box, cells = CellBox(*cell, cell[0] + 1, cell[1] + 1), self._window.default_cells()
            for layer in self.layers.enabled:
                was_lethal = cells[cell[1], cell[0]] == LETHAL
                self._write([layer], cells, box)
                if not was_lethal and cells[cell[1], cell[0]] == LETHAL:
                    reason = layer.lethal_reason(x, y)
                    return f"{layer.name} ({reason})" if reason else layer.name
        return ""

    def without_areas(self, x: float, y: float, reach: float) -> Costmap:
        """What all layers but those of drawn areas give in a square of ``reach`` [m] around (x, y), or the whole map.

        It is the snapshot itself where no layer draws areas.
        """
        with self._lock:
            enabled = list(self.layers.enabled)
            others = [layer for layer in enabled if not layer.draws_areas]
            if len(others) == len(enabled):
                return self.snapshot()
            low = self.geometry.world_to_cell_clamped(x - reach, y - reach)
            high = self.geometry.world_to_cell_clamped(x + reach, y + reach)
            box = CellBox(*low, high[0] + 1, high[1] + 1)
            cells = self._window.default_cells()
            self._write(others, cells, box)
            self._window.compute_all()  # layers may have kept notes of these cells, which are not those of the map
            return self._window.costmap(cells, self.snapshot().stamp).part(box)

    def _write(self, layers: Iterable[CostmapLayer], cells: CellArray, box: CellBox) -> None:
        for layer in layers:
            with self.layers.computing(layer):
                layer.update_costs(cells, box)
