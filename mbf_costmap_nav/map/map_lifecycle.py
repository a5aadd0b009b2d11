"""Run a costmap only while somebody uses it: a count of users, and a delayed stop.

MBF's costmap wrapper. The delay exists so that a get_path followed by an exe_path does not restart the map. There is no
timer thread here: the server calls ``poll`` in its update loop, and time comes from the injected clock.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.time.clock import Clock


class MapLifecycleParameters(ParameterModel):
    """When a map is shut down."""

    shutdown_costmaps: bool = parameter(False, "Stop the map while nobody uses it; otherwise it always runs.")
    shutdown_costmaps_delay: float = parameter(1.0, "Time from the last use to the stop.", unit="s", ge=0.0)
    clear_on_shutdown: bool = parameter(False, "Clear the map before it stops.")


class MapLifecycle:
    """Users of one map.

    Parameters
    ----------
    clock : Clock
    parameters : MapLifecycleParameters
    start, stop : callable
        Begin and end updating the map. Called under the lock of this object: they must not call back.
    clear : callable
        Clear the map; called before ``stop`` if so configured, since a stopped map may not forget.
    """

    def __init__(
        self,
        clock: Clock,
        parameters: MapLifecycleParameters,
        start: Callable[[], None],
        stop: Callable[[], None],
        clear: Callable[[], None],
    ) -> None:
        self._clock = clock
        self._parameters = parameters
        self._start, self._stop, self._clear = start, stop, clear
        self._lock = threading.Lock()
        self._users = 0
        self._running = False
        self._idle_since = 0.0
        self.configure(parameters)

    @property
    def running(self) -> bool:
        """Whether the map is being updated."""
        return self._running

    @property
    def users(self) -> int:
        """Number of activations not yet given back."""
        return self._users

    def configure(self, parameters: MapLifecycleParameters) -> None:
        """Take over new parameters; a map that shall always run is started at once."""
        with self._lock:
            self._parameters = parameters
            if not parameters.shutdown_costmaps:
                self._ensure_running()
            self._idle_since = self._clock.now()

    def activate(self) -> None:
        """Add a user; start the map if it stands."""
        with self._lock:
            self._users += 1
            self._ensure_running()

    def deactivate(self) -> None:
        """Remove a user; the last one starts the delay.

        Raises
        ------
        RuntimeError
            There is no user.
        """
        with self._lock:
            if self._users == 0:
                raise RuntimeError("deactivate without activate")
            self._users -= 1
            self._idle_since = self._clock.now()

    @contextmanager
    def in_use(self) -> Iterator[None]:
        """Be a user for the time of a ``with`` block, whatever happens in it."""
        self.activate()
        try:
            yield
        finally:
            self.deactivate()

    def poll(self) -> None:
        """Stop the map if it has been idle for the delay; to be called regularly."""
        with self._lock:
            idle = self._clock.now() - self._idle_since
            due = self._parameters.shutdown_costmaps and idle >= self._parameters.shutdown_costmaps_delay
            if not (due and self._running and self._users == 0):
                return
            if self._parameters.clear_on_shutdown:
                self._clear()
            self._stop()
            self._running = False

    def _ensure_running(self) -> None:
        if not self._running:
            self._start()
            self._running = True
