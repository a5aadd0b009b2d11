"""Bad answers for scripted plugins, one function for each fault.

Give them to ``play`` of a scripted plugin. Those that need time take the clock.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.plugins import ControlRequest, ControlResult, PlanRequest, PlanResult
from mbf_abstract.testing.scripted import Answer, straight_plan
from mbf_abstract.time.cancel import CancelToken
from mbf_abstract.time.clock import Clock


class Hang:
    """Never returns until ``release`` is called, also when it is canceled.

    It waits on the clock, so simulated time goes on around it. For a call that keeps the processor busy and so stops
    simulated time use ``BusyHang``.
    """

    def __init__(self, clock: Clock, then: Answer = None) -> None:
        self.entered = 0
        self.left = 0
        self._then = then
        self._released = False
        self._condition = clock.condition()

    def __call__(self, request: object) -> Any:
        """Hang; once released give the answer ``then``."""
        self.entered += 1
        with self._condition:
            while not self._released:
                self._condition.wait()
        self.left += 1
        return self._then(request) if callable(self._then) else self._then

    def release(self) -> None:
        """Let the present call and all later ones return."""
        with self._condition:
            self._released = True
            self._condition.notify_all()


class BusyHang:
    """Keeps the processor busy and never waits, until ``release`` is set: only a wall-clock guard finds it."""

    def __init__(self) -> None:
        self.entered = 0
        self.left = 0
        self.release = CancelToken()

    def __call__(self, request: object) -> None:
        """Spin."""
        self.entered += 1
        while not self.release.cancelled:
            pass
        self.left += 1


def slow(clock: Clock, seconds: float, answer: Answer) -> Callable[[Any], Any]:
    """Give ``answer`` after ``seconds``, ignoring the cancel token meanwhile."""

    def call(request: Any) -> Any:
        clock.sleep(seconds)
        return answer(request) if callable(answer) else answer

    return call


def obedient(clock: Clock, seconds: float, answer: Answer, canceled: Answer) -> Callable[[Any], Any]:
    """Give ``answer`` after ``seconds``, or ``canceled`` soon after the request's token is set."""

    def call(request: Any) -> Any:
        end = clock.now() + seconds
        while clock.now() < end:
            if request.cancel_token.cancelled:
                return canceled
            clock.sleep(min(0.02, end - clock.now()))
        return answer(request) if callable(answer) else answer

    return call


def empty_path(request: PlanRequest) -> PlanResult:
    """Claim success with a path of no poses."""
    return PlanResult(GetPathOutcome.SUCCESS, "found", Path.from_poses([]))


def no_path(request: PlanRequest) -> PlanResult:
    """Claim success without any path."""
    return PlanResult(GetPathOutcome.SUCCESS, "found")


def nan_path(request: PlanRequest) -> PlanResult:
    """Try to make a path with a NaN in it."""
    path = Path.from_points([request.start.position, (float("nan"), 0.0, 0.0), request.goal.position])
    return PlanResult(GetPathOutcome.SUCCESS, "found", path)


def wrong_frame_path(request: PlanRequest) -> PlanResult:
    """Give a path in an unknown frame."""
    plan = straight_plan(request)
    assert plan.path is not None
    return replace(plan, path=replace(plan.path, frame_id="nowhere"))


def path_that_ends_elsewhere(request: PlanRequest) -> PlanResult:
    """Claim success with a path that ends 5 m beside the goal."""
    x, y, z = request.goal.position
    return straight_plan(replace(request, goal=replace(request.goal, position=(x, y + 5.0, z))))


def path_that_starts_elsewhere(request: PlanRequest) -> PlanResult:
    """Claim success with a path that starts 5 m beside the robot."""
    start = Pose((request.start.x, request.start.y + 5.0, request.start.z), frame_id=request.start.frame_id)
    return straight_plan(replace(request, start=start))


def nan_command(request: ControlRequest) -> ControlResult:
    """Try to make a command of NaN."""
    return ControlResult(ExePathOutcome.SUCCESS, "go", Twist.planar(float("nan")))


def no_command(request: ControlRequest) -> ControlResult:
    """Claim success without a command."""
    return ControlResult(ExePathOutcome.SUCCESS, "go")


def drive(vx: float = 0.5, wz: float = 0.0) -> ControlResult:
    """Drive on and on with one velocity [m/s, rad/s]."""
    return ControlResult(ExePathOutcome.SUCCESS, "driving", Twist.planar(vx, wz=wz))
