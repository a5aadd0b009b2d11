"""Where the robot would have planned: one plan in the middle of a replay, which goes on meanwhile."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

from mbf_abstract.commands.coordinates import Place
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import GetPathGoal, RefinePathGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import GetPathResult
from mbf_abstract.navigator import Navigator


class ReplayedPlan:
    """One plan from where the robot is to a goal, sent through the configuration's ``plan_refiner``.

    Parameters
    ----------
    planner : str
        Name; the first one if empty.
    shown_frame : str
        Frame of the map that is shown.

    Attributes
    ----------
    goal : Pose
    start : Pose or None
        Where the robot was; None where that was not known.
    time : float
        When it was planned [s].
    result : GetPathResult or None
        Once it is there.
    path : Path or None
        The plan, refined.
    shown_goal : Pose or None
    shown_path : Path or None
        In the frame of the map that is shown, by the transforms of the moment; None where they cannot be placed in it.
    note : str
        Why the plan was not refined; empty if it was, or is not meant to be.
    """

    def __init__(self, navigator: Navigator, place: Place, planner: str, shown_frame: str) -> None:
        self._navigator, self._planner, self._shown_frame = navigator, planner, shown_frame
        server = navigator.server
        if server.ground_is_level:
            place = place.on_flat_map()
        self.goal: Pose = server.ground_pose(place.x, place.y, place.yaw or 0.0)
        if place.z is not None:
            frame = server.config.parameters.global_frame
            self.goal = Pose.planar(place.x, place.y, place.yaw or 0.0, place.z, frame_id=frame)
        self.start: Pose | None = None
        self.time = 0.0
        self.result: GetPathResult | None = None
        self.path: Path | None = None
        self.shown_goal: Pose | None = None
        self.shown_path: Path | None = None
        self.note = ""
        self._handle: AnyGoalHandle | None = None

    def begin(self, now: float) -> None:
        """Send the goal."""
        self.time = now
        try:
            self.start = self._navigator.robot_pose()
        except RobotStateError:
            self.start = None  # the result says why
        with suppress(TransformError):
            self.shown_goal = self._transforms.transform_pose(self.goal, self._shown_frame)
        self._handle = self._navigator.send(GetPathGoal(self.goal, planner=self._planner))

    def look(self) -> None:
        """Take what is done by now; a plan is then refined."""
        if self._handle is None or not self._handle.done:
            return
        handle, self._handle = self._handle, None
        if self.result is None:
            self._take_plan(handle.wait())
        else:
            self._take_refined(handle.wait())

    def finish(self) -> None:
        """Wait for what is still to come."""
        while self._handle is not None:
            self._handle.wait()
            self.look()

    def _take_plan(self, result: Any) -> None:
        self.result = result
        self._take_path(result.path)
        refiner = self._navigator.server.config.parameters.plan_refiner
        if result.success and result.path is not None and refiner:
            self._handle = self._navigator.send(RefinePathGoal(result.path, refiner))

    def _take_refined(self, result: Any) -> None:
        if result.success and result.refined_path is not None:
            self._take_path(result.refined_path)
        else:
            self.note = f"the plan was not refined: {result.outcome_name}: {result.message}"

    def _take_path(self, path: Path | None) -> None:
        self.path, self.shown_path = path, None
        if path is not None:
            with suppress(TransformError):
                self.shown_path = self._transforms.transform_path(path, self._shown_frame)

    @property
    def _transforms(self) -> TransformBuffer:
        return self._navigator.server.runtime.transforms

    def to_json(self, began: float) -> dict[str, Any]:
        """Everything, times in seconds from ``began``, poses as x y z qx qy qz qw."""
        assert self.result is not None
        return {
            "at_s": round(self.time - began, 6),
            "outcome": int(self.result.outcome),
            "outcome_name": self.result.outcome_name,
            "message": self.result.message,
            "planner": self.result.planner,
            "cost": round(self.result.cost, 6) if math.isfinite(self.result.cost) else None,
            "length_m": round(self.path.length, 6) if self.path is not None else None,
            "start": None if self.start is None else [*self.start.position, *self.start.orientation],
            "goal": [*self.goal.position, *self.goal.orientation],
            "note": self.note,
            "poses": [] if self.path is None else [[*pose.position, *pose.orientation] for pose in self.path],
        }
