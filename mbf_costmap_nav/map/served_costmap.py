"""A costmap as the server runs it: updated at its own rate, all the time or only while it is in use.

With ``shutdown_costmaps`` a map stops after ``shutdown_costmaps_delay`` without users, as in MBF's costmap wrapper. The
delay exists so that an exe_path soon after a get_path does not restart the map.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.maps.served_map import ServedMap
from mbf_costmap_nav.map.costmap_config import CostmapParameters
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap


class ServedCostmap(ServedMap[LayeredCostmap]):
    """A served map with a count of its users. Every start brings an update, as the map of the last stop is too old."""

    def __init__(self, costmap: LayeredCostmap, runtime: Runtime, parameters: CostmapParameters, name: str) -> None:
        self.map, self._runtime = costmap, runtime  # the first update comes before the ticks
        self._lock = threading.Lock()
        self._users, self._running, self._idle_since = 0, False, runtime.clock.now()
        if not runtime.parameters.shutdown_costmaps:
            self._start()
        frequency, tolerance = parameters.update_frequency, parameters.transform_tolerance
        super().__init__(costmap, runtime, name, parameters, frequency, tolerance)

    @contextmanager
    def in_use(self) -> Iterator[None]:
        """Keep the map updated for the time of a ``with`` block."""
        with self._lock:
            self._start()
            self._users += 1
        try:
            yield
        finally:
            with self._lock:
                self._users -= 1
                self._idle_since = self._runtime.clock.now()

    def _start(self) -> None:
        if not self._running:
            self.update()
            self._running = True

    def _tick(self) -> None:
        with self._lock:
            self._start_or_stop()
        if self._running:
            self.update()

    def _start_or_stop(self) -> None:
        """Keep a map running that has users or shall not stop; stop and clear one that has been idle for the delay."""
        parameters, now = self._runtime.parameters, self._runtime.clock.now()
        if self._users or not parameters.shutdown_costmaps:
            self._idle_since = now
            self._start()
        elif self._running and now - self._idle_since >= parameters.shutdown_costmaps_delay:
            if parameters.clear_on_shutdown:
                self.map.clear()
            self._running = False
