"""Plugins that play the answers of a test; without answers they work, and need no map.

``play`` gives a plugin its answers, one per call; the last one is repeated for ever. An answer is a result, an
exception to raise, or a function of the request that makes either. ``mbf_abstract.testing.faulty`` has bad ones.

Example
-------
>>> planner.play(PlanResult(GetPathOutcome.NO_PATH_FOUND, "blocked"), straight_plan)
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np

from mbf_abstract.geometry import Path, Pose, Twist, normalize_angle
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import (
    AbstractController,
    AbstractPlanner,
    AbstractRecovery,
    AbstractRefiner,
    ControlRequest,
    ControlResult,
    PlanRequest,
    PlanResult,
    PluginContext,
    RecoveryRequest,
    RecoveryResult,
    RefineResult,
)
from mbf_abstract.time.cancel import CancelToken

Request = TypeVar("Request")
Answer: TypeAlias = Any
"""A result, an exception, or a function of the request that returns one of them."""


class Scripted(Generic[Request]):
    """The scripted part of a plugin: the answers it plays and the requests it got."""

    def __init__(self, *answers: Answer) -> None:
        self.requests: list[Request] = []
        self.play(*answers)

    def play(self, *answers: Answer) -> None:
        """Give these answers from the next call on."""
        self._answers = answers
        self._calls = 0

    def _answer(self, request: Request) -> Any:
        self.requests.append(request)
        answer = self._answers[min(self._calls, len(self._answers) - 1)]
        self._calls += 1
        if callable(answer):
            answer = answer(request)
        if isinstance(answer, BaseException):
            raise answer
        return answer


def straight_plan(request: PlanRequest) -> PlanResult:
    """Plan a straight line with a pose every 0.1 m, whatever is in the way."""
    points = np.array([pose.position for pose in (request.start, *request.via, request.goal)])
    legs = [_straight_leg(a, b) for a, b in pairwise(points)]
    positions = np.concatenate([*legs, points[-1:]])
    path = Path.from_points(positions, request.goal.orientation, frame_id=request.start.frame_id)
    return PlanResult(GetPathOutcome.SUCCESS, "a straight line", path, path.length)


def _straight_leg(a: Any, b: Any) -> Any:
    count = max(1, math.ceil(float(np.linalg.norm(b - a)) / 0.1))
    return a + (b - a) * np.arange(count)[:, None] / count


class ScriptedPlanner(AbstractPlanner, Scripted[PlanRequest]):
    """Plans straight lines until it is set to ``play`` something else."""

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        Scripted.__init__(self, straight_plan)

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Give the next answer."""
        return self._answer(request)  # type: ignore[no-any-return]


class ScriptedController(AbstractController, Scripted[ControlRequest]):
    """Follows the path as a robot that can move sideways, until it is set to ``play`` something else.

    Attributes
    ----------
    accepts_plan : bool
        What ``set_plan`` answers.
    stops_itself : bool
        Answer ``cancel`` with True, slow down for five cycles and then return CANCELED.
    """

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        Scripted.__init__(self, self.follow)
        self.paths: list[Path] = []
        self.accepts_plan = True
        self.stops_itself = False
        self.cancel_calls = 0
        self._cycles_to_stop: int | None = None

    def set_plan(self, path: Path) -> bool:
        """Take the path."""
        self.paths.append(path)
        self._cycles_to_stop = None
        return self.accepts_plan

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Give the next answer."""
        if self._cycles_to_stop is not None:
            return self._slow_down()
        return self._answer(request)  # type: ignore[no-any-return]

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Compare with the last pose of the path; tolerances in m and rad."""
        goal = self.paths[-1][-1]
        return pose.distance_to(goal) <= dist_tolerance and pose.angle_to(goal) <= angle_tolerance

    def cancel(self) -> bool:
        """Count the call."""
        self.cancel_calls += 1
        if self.stops_itself and self._cycles_to_stop is None:
            self._cycles_to_stop = 5
        return self.stops_itself

    def follow(self, request: ControlRequest, speed: float = 0.5, look_ahead: float = 0.4) -> ControlResult:
        """Drive towards the pose of the path that is ``look_ahead`` [m] beyond the nearest one."""
        path, pose = self.paths[-1], request.pose
        offsets = path.positions[:, :2] - np.array(pose.position[:2])
        nearest = int(np.argmin(np.hypot(*offsets.T)))
        remaining = path.remaining_lengths
        target = int(np.searchsorted(-remaining, look_ahead - remaining[nearest]))
        index = min(target, len(path) - 1)
        distance = float(np.hypot(*offsets[index]))
        scale = min(speed, 2.0 * distance) / max(distance, 1e-9)
        dx, dy = offsets[index] * scale
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        turn = max(-1.0, min(1.0, 2.0 * normalize_angle(path[index].yaw - pose.yaw)))
        command = Twist.planar(float(c * dx + s * dy), float(c * dy - s * dx), turn)
        return ControlResult(ExePathOutcome.SUCCESS, "following", command)

    def _slow_down(self) -> ControlResult:
        assert self._cycles_to_stop is not None
        self._cycles_to_stop -= 1
        if self._cycles_to_stop <= 0:
            return ControlResult(ExePathOutcome.CANCELED, "stopped by myself", Twist())
        return ControlResult(ExePathOutcome.SUCCESS, "slowing down", Twist.planar(0.05 * self._cycles_to_stop))


class ScriptedRecovery(AbstractRecovery, Scripted[RecoveryRequest]):
    """Succeeds at once until it is set to ``play`` something else."""

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        Scripted.__init__(self, RecoveryResult(RecoveryOutcome.SUCCESS, "recovered"))

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Give the next answer."""
        return self._answer(request)  # type: ignore[no-any-return]


class ScriptedRefiner(AbstractRefiner, Scripted[Path]):
    """Gives back the path it got until it is set to ``play`` something else."""

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        Scripted.__init__(self, lambda path: RefineResult(0, "as it was", path))

    def apply_refinement(self, path: Path, cancel_token: CancelToken) -> RefineResult:
        """Give the next answer."""
        return self._answer(path)  # type: ignore[no-any-return]
