"""The part of a tiled map around the robot, as one mesh map: what sensors see is marked on it, controllers drive on it.

It is cut out like any surroundings. The layers of the configuration are computed on it, with the stored ones as inputs.
A window never moves: when the robot comes near its edge a new one is cut out around it, whose layers take over what
lies on both. What lies off the new one is forgotten, so memory is bounded by the side of the window.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from mbf_abstract.maps.layers.layer_list import made_layer, making
from mbf_mesh_nav.map.layer import LayerContext, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.sensed import NOTHING_SENSED, SensedCosts
from mbf_mesh_nav.tiles.serving.surroundings import StoredLayer, Surroundings, stored_layer
from mbf_mesh_nav.tiles.serving.windows.window_settings import MOVES_AT, SHOWN, WindowSettings


class Window:
    """One window.

    Parameters
    ----------
    around : Surroundings
        What was cut out.
    middle : (x, y)
        [m]
    profile_layer : str
        The stored layer that plans are made with.
    old : Window, optional
        The one before, whose layers hand on what they have sensed.

    Attributes
    ----------
    map : MeshMap
        With the layers of the configuration.
    middle : (x, y)
        [m]

    Raises
    ------
    LayerListError
        A layer raises; the text names it.
    """

    def __init__(
        self,
        around: Surroundings,
        middle: tuple[float, float],
        settings: WindowSettings,
        profile_layer: str,
        old: Window | None = None,
    ) -> None:
        self.map: MeshMap = around.map
        self._numbers, self.middle, self._side = around.numbers, middle, settings.side
        self._stored = around.map.layers[profile_layer]
        self._last: tuple[int, SensedCosts] = (-1, NOTHING_SENSED)  # version of the snapshot
        if settings.planned:
            layers = self._layers(settings, around.map, old)
            self.map.set_layers(LayerGraph(layers), SHOWN, around.map.edge_cost_factor)

    def _layers(self, settings: WindowSettings, mesh_map: MeshMap, old: Window | None) -> list[MeshLayer]:
        layers: dict[str, MeshLayer] = {}
        for one in settings.planned:
            name = one.entry.name
            if one.layer_class is StoredLayer:
                values = mesh_map.layers[name] if name in mesh_map.layers else self._stored
                layers[name] = stored_layer(mesh_map, name, values.costs, values.lethal)
                continue
            before = old.map.layers[name] if old is not None else None
            parameters: Any = one.parameters if before is None else before.parameters
            inputs = tuple(layers[read] for read in one.entry.reads)
            context = LayerContext(name, mesh_map.topology, mesh_map.locator, parameters, inputs, mesh_map.frame_id)
            layers[name] = layer = made_layer(name, partial(one.layer_class, context), passing=(MeshError,))
            with making(name, passing=(MeshError,)):
                if before is not None:
                    layer.take_over(before)
                layer.recompute()
        return list(layers.values())

    def holds(self, x: float, y: float, radius: float) -> bool:
        """Whether a disc [m] lies in the window."""
        return self._distance(x, y) + radius <= 0.5 * self._side

    def is_central(self, x: float, y: float) -> bool:
        """Whether a robot at a place [m] needs no other window yet."""
        return self._distance(x, y) <= MOVES_AT * self._side

    def _distance(self, x: float, y: float) -> float:
        return max(abs(x - self.middle[0]), abs(y - self.middle[1]))

    def sensed(self, snapshot: MeshSnapshot) -> SensedCosts:
        """Where a snapshot of the map is worse than what is stored; the same value as long as it is the same."""
        version, last = self._last
        if snapshot.version == version:
            return last
        raised = (snapshot.costs > self._stored.costs) | (snapshot.lethal & ~self._stored.lethal)
        where = np.flatnonzero(raised)
        values = self._numbers[where], snapshot.costs[where], snapshot.lethal[where]
        found = SensedCosts.at(*values, self.map.vertices[where])
        self._last = snapshot.version, last if found.is_same(last) else found
        return self._last[1]
