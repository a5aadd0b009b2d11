"""A costmap as the server runs it: updated at its own rate, but only while somebody needs it."""

from __future__ import annotations

from contextlib import AbstractContextManager

from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.maps.served_map import ServedMap
from mbf_costmap_nav.map.costmap_config import CostmapParameters
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.map.map_lifecycle import MapLifecycle, MapLifecycleParameters


def _nothing() -> None:
    """Stopping needs no more than the flag the tick looks at."""


class ServedCostmap(ServedMap[LayeredCostmap]):
    """A served map that stops after a while without users, if the server's parameters say so.

    Every start brings an update, as nobody may see the map of the last stop.
    """

    def __init__(self, costmap: LayeredCostmap, runtime: Runtime, parameters: CostmapParameters, name: str) -> None:
        self.map, self._runtime = costmap, runtime  # the life cycle begins with an update, and before the ticks
        self._limits = self._lifecycle_parameters()
        self._lifecycle = MapLifecycle(runtime.clock, self._limits, self.update, _nothing, self._clear)
        frequency, tolerance = parameters.update_frequency, parameters.transform_tolerance
        super().__init__(costmap, runtime, name, parameters, frequency, tolerance)

    def in_use(self) -> AbstractContextManager[None]:
        """Keep the map updated for the time of a ``with`` block."""
        return self._lifecycle.in_use()

    def _clear(self) -> None:
        self.map.clear()

    def _tick(self) -> None:
        wanted = self._lifecycle_parameters()
        if wanted != self._limits:
            self._limits = wanted
            self._lifecycle.configure(wanted)
        self._lifecycle.poll()
        if self._lifecycle.running:
            self.update()

    def _lifecycle_parameters(self) -> MapLifecycleParameters:
        parameters = self._runtime.parameters
        return MapLifecycleParameters(
            shutdown_costmaps=parameters.shutdown_costmaps,
            shutdown_costmaps_delay=parameters.shutdown_costmaps_delay,
            clear_on_shutdown=parameters.clear_on_shutdown,
        )
