"""A costmap as the server runs it: updated at its own rate, but only while somebody needs it."""

from __future__ import annotations

from contextlib import AbstractContextManager

from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.execution.ticker import Ticker
from mbf_abstract.geometry import Pose
from mbf_abstract.robot import RobotStateError
from mbf_abstract.transforms import TransformError
from mbf_costmap_nav.layered_costmap import LayeredCostmap
from mbf_costmap_nav.map_lifecycle import MapLifecycle, MapLifecycleParameters


def _nothing() -> None:
    """Stopping needs no more than the flag the tick looks at."""


class ServedCostmap:
    """Keeps one costmap up to date.

    Parameters
    ----------
    update_frequency : float
        Rate of the updates [Hz].
    """

    def __init__(self, costmap: LayeredCostmap, runtime: Runtime, update_frequency: float, name: str) -> None:
        self.costmap = costmap
        self._runtime = runtime
        self._parameters = self._lifecycle_parameters()
        self._lifecycle = MapLifecycle(runtime.clock, self._parameters, self._update, _nothing, self._clear)
        self._ticker = Ticker(runtime.clock, runtime.events, self._tick, 1.0 / update_frequency, name)

    def in_use(self) -> AbstractContextManager[None]:
        """Keep the map updated for the time of a ``with`` block."""
        return self._lifecycle.in_use()

    def close(self) -> None:
        """End the updates."""
        self._ticker.stop()

    def _tick(self) -> None:
        wanted = self._lifecycle_parameters()
        if wanted != self._parameters:
            self._parameters = wanted
            self._lifecycle.configure(wanted)
        self._lifecycle.poll()
        if self._lifecycle.running:
            self._update()

    def _update(self) -> None:
        """One update, also at every start, as nobody may see the map of the last stop.

        A rolling map keeps its place while the robot's pose is unknown.
        """
        try:
            pose: Pose | None = self._in_map_frame(self._runtime.robot.pose())
        except (RobotStateError, TransformError):
            pose = None
        self.costmap.update(pose, self._runtime.clock.now())

    def _in_map_frame(self, pose: Pose) -> Pose:
        if pose.frame_id == self.costmap.frame_id:
            return pose
        return self._runtime.transforms.transform_pose(pose, self.costmap.frame_id)

    def _clear(self) -> None:
        self.costmap.clear()

    def _lifecycle_parameters(self) -> MapLifecycleParameters:
        parameters = self._runtime.parameters
        return MapLifecycleParameters(
            shutdown_costmaps=parameters.shutdown_costmaps,
            shutdown_costmaps_delay=parameters.shutdown_costmaps_delay,
            clear_on_shutdown=parameters.clear_on_shutdown,
        )
