"""Pulling out: search the nearest place beside the paths that must stay free, and drive there; a base of recoveries.

Where a command is refused on the way, the robot waits for ``PAUSE``, in which somebody who moves there stops or passes,
and searches anew, ``ATTEMPTS`` times in all. A robot that stands without a goal and is asked for room does only this:
see ``make_room`` and ``server.making_room``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import TypeAlias

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.arcs import in_robot_frame
from mbf_abstract.maps.manoeuvres import Step, driven_back
from mbf_abstract.maps.pull_out import find_pull_out, paths_on_storey
from mbf_abstract.maps.recoveries.manoeuvre_recovery import ManoeuvreParameters, ManoeuvreRecovery
from mbf_abstract.maps.recoveries.wait import stand
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.right_of_way import MEETING_LENGTH, distance_between

ATTEMPTS, PAUSE = 4, 2.0  # to drive to a place; s between two of them
PathsToKeepFree: TypeAlias = Callable[[Pose, Pose], Iterable[FloatArray]]
"""What to keep free, the best first: points (n, 2) [m] in the plane of the robot where the search begins, for that pose
and the pose at which the robot stood when it set out."""


class PullingOutParameters(ManoeuvreParameters):
    """Parameters of a recovery that pulls out."""

    distance: float = parameter(
        0.8,
        "How far its base stands from its path, at least: how far its outline reaches, half the width of another one "
        "like it, and a margin. Others meet it where their path comes nearer; of two that announce theirs, the mean "
        "counts.",
        unit="m",
        gt=0.0,
        le=5.0,
    )
    reach: float = parameter(4.0, "Longest manoeuvre to such a place.", unit="m", gt=0.0, le=20.0)


class PullingOutRecovery(ManoeuvreRecovery):
    """Base of the recoveries that pull out."""

    parameters: PullingOutParameters
    _driven: tuple[Pose, list[Step]] | None = None
    """The last manoeuvre that led to a place, and where it began."""

    @property
    def meeting_distance(self) -> float:
        """Others meet it where their path comes nearer than this [m]."""
        return self.parameters.distance

    def rivals(self) -> tuple[Announcement, ...]:
        """Those that it meets; no fewer than those for which it was run as ``right_of_way_behavior``."""
        p = self.parameters
        return self.traffic.meet(self.clock.now(), p.distance, max(p.reach, MEETING_LENGTH))

    def distance_to(self, robots: Iterable[Announcement]) -> float:
        """How far its base stands from its path and theirs [m], at least: as far as the largest of them needs."""
        own = self.parameters.distance
        return max((distance_between(own, robot) for robot in robots), default=own)

    def make_room(self, request: RecoveryRequest) -> RecoveryResult:
        """Pull out for the robots that ask one without a goal, and stop there."""
        rivals = self.rivals()
        asking = {rival.name for rival in rivals}
        if not asking:
            return RecoveryResult(RecoveryOutcome.SUCCESS, "nobody asks for room any more")

        def keep_free(begin: Pose, course: Pose) -> Iterator[FloatArray]:
            return self._paths_of_others(begin, asking)

        result = self.pull_out(request, keep_free, "the paths of others", self.distance_to(rivals))
        if not result.success:
            return result
        place, names = request.motion.pose(), ", ".join(sorted(asking))
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"makes room for {names} at ({place.x:.2f}, {place.y:.2f})")

    def _paths_of_others(self, begin: Pose, asking: set[str]) -> Iterator[FloatArray]:
        """Yield the paths of all robots that go somewhere, then those of the robots that ask."""
        going = [other for other in self.traffic.others(self.clock.now()) if other.remaining > 0.0]
        for chosen in (going, [other for other in going if other.name in asking]):
            points = paths_on_storey(begin, [other.points_ahead(math.inf) for other in chosen])
            if len(points):
                yield points

    def pull_out(
        self, request: RecoveryRequest, keep_free: PathsToKeepFree, beside: str, distance: float
    ) -> RecoveryResult:
        """Search a place and drive there section by section; search anew where the drive there is not free.

        ``beside`` says in the text of a failure what the place has to be beside of, by ``distance`` [m].
        """
        p, token = self.parameters, request.cancel_token
        result = RecoveryResult(RecoveryOutcome.CANCELED, token.reason)
        course, self._driven = request.motion.pose(), None
        for attempt in range(ATTEMPTS):
            if attempt:
                paused = stand(request, PAUSE)  # somebody who moves there stops before this robot, or passes
                if not paused.success:
                    return paused
            begin = request.motion.pose()
            steps = self._manoeuvre(begin, keep_free(begin, course), distance, request)
            if token.cancelled:
                return RecoveryResult(RecoveryOutcome.CANCELED, token.reason)
            if steps is None:
                text = f"no place {distance:.3g} m beside {beside} within a manoeuvre of {p.reach:g} m"
                return RecoveryResult(RecoveryOutcome.IMPASSABLE, text)
            self.traffic.set_cannot_yield(False)
            result = self.drive_along(begin, steps, request)
            if result.outcome != RecoveryOutcome.IMPASSABLE:
                self._driven = begin, steps
                break
        return result

    def drive_back(self, request: RecoveryRequest, is_enough: Callable[[Pose], bool]) -> RecoveryResult:
        """Drive the manoeuvre that led to the place where it stands back, until it ``is_enough`` after a section."""
        if self._driven is None or not self._driven[1]:
            return RecoveryResult(RecoveryOutcome.SUCCESS)
        begin, steps = self._driven
        return self.drive_along(begin, driven_back(steps), request, steps[-1].poses[-1], is_enough)

    def turns_to(self, begin: Pose, pose: Pose) -> bool:
        """Whether it can turn on the spot to its path, straight on from ``begin``; a car, which never does, counts."""
        on = in_robot_frame(begin, np.asarray(pose.position))[0] + self.parameters.distance
        ahead, left = in_robot_frame(pose, np.asarray(begin.position) + on * begin.rotation[:, 0])[:2]
        turn = math.atan2(left, ahead)
        command, seconds = Twist.planar(wz=math.copysign(1.0, turn)), abs(turn)
        is_car, navigation_map = self.min_turning_radius > 0.0, self.navigation_map
        return is_car or not navigation_map.obstacle_on_path(self.on_map(pose), command, seconds)

    def _manoeuvre(
        self, begin: Pose, keep_free: Iterable[FloatArray], distance: float, request: RecoveryRequest
    ) -> list[Step] | None:
        """Shortest manoeuvre in the plane of ``begin`` to a place beside the first of these for which there is one."""
        p, token = self.parameters, request.cancel_token
        start, turning_radius = self.on_map(begin), self.min_turning_radius
        for free in keep_free:
            steps = find_pull_out(
                self.navigation_map, start, free, distance, p.reach, turning_radius, lambda: token.cancelled
            )
            if steps is not None or token.cancelled:
                return steps
        return None
