"""A controller for one mesh, driven on the window around the robot.

A mesh controller is bound to one map. When the window has moved, the next call makes a new instance on the new one,
with the same parameters and random numbers, and gives it what is left of the path. Controllers with a memory of past
commands, such as ``mppi``, begin anew there, as they do with every new plan.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import AbstractController, ControlRequest, ControlResult, PlannedMotion
from mbf_mesh_nav.plugins import MeshController
from mbf_mesh_nav.tiles.serving.navigation_map import TiledNavigationMap
from mbf_mesh_nav.tiles.serving.parts import OnWindow


class WindowController(OnWindow[MeshController], AbstractController):
    """Hands everything to a controller on the present window."""

    def __init__(self, controller_class: type[MeshController], context: MapContext[TiledNavigationMap]) -> None:
        super().__init__(controller_class, context)
        self._tracker: PathTracker | None = None
        self._accepted = True

    @property
    def turns_on_the_spot(self) -> bool:
        """As the controller."""
        return self._inner.turns_on_the_spot

    def set_plan(self, path: Path) -> bool:
        """Take over a path, which may lead out of the window."""
        self._tracker, self._accepted = None, True
        if not self.hand_on(self._on_window(), path):
            return False
        self._tracker = PathTracker(path)
        return True

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """One cycle of the controller on the present window."""
        self._follow(request.pose)
        inner = self._on_window()
        if not self._accepted:
            text = "the controller does not take what is left of the path on another window"
            why = inner.refusal
            return ControlResult(ExePathOutcome.INVALID_PATH, f"{text}: {why}" if why else text)
        return inner.compute_velocity_commands(request)

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """As the controller."""
        self._follow(pose)
        return self._on_window().is_goal_reached(pose, dist_tolerance, angle_tolerance)

    def planned_motion(self) -> PlannedMotion | None:
        """As the controller."""
        return self._inner.planned_motion()

    def parameters_changed(self) -> None:
        """Hand them on; those that the controller refuses, or with which it looks beyond the window, are not kept."""
        self._require_room()
        old, self._inner.parameters = self._inner.parameters, self.parameters
        try:
            self._inner.parameters_changed()
        except BaseException:
            self._inner.parameters = old
            raise

    def _follow(self, pose: Pose) -> None:
        if self._tracker is not None:
            self._tracker.update(pose.position)

    def _on_window(self) -> MeshController:
        """The controller on the window of now."""
        if self._inner.mesh_map is not self._map.window_map:
            self._inner = self._made()
            if self._tracker is not None:
                self._accepted = self._inner.set_plan(_left(self._tracker))
        return self._inner


def _left(tracker: PathTracker) -> Path:
    """The path from the last pose that the robot has passed."""
    passed = int(np.searchsorted(tracker.lengths, tracker.progress, side="right")) - 1
    return tracker.path[max(min(passed, len(tracker.path) - 2), 0) :]
