"""Give way: leave the path to where another robot can pass, and wait.

When to use: as ``right_of_way_behavior``; in ``escalation_behaviors``, against whoever stands head on in a corridor or
a door and waits for us. When not: things that never move; plan around those. Give two robots of the same kind different
seeds: both may give way at first, the waits they draw let one go on before the other.

Its path is the track that the robot has driven, straight ahead and straight on behind the track. The nearest place is
searched where the base stands ``distance`` from all of it, by the shortest manoeuvre on which the outline touches
nothing the map knows: back into a bay, around a corner, or a step aside in a hall; see ``maps.pull_out``. Who is
tracked near its path is taken to go beside it, and that path is kept free, too, where there is such a place. The
manoeuvre is driven slowly, each command checked as in every recovery, and searched anew where one is refused (see
``pulling_out``); afterwards it stands for a time that is drawn anew for each run, or until those who were tracked on
its path, since it set out, have left it. Where who stood ahead drives on, it had waited for somebody else, and the
robot stops where it can turn to its path (see ``left_path``). Where it could not turn to its path in the place, it
drives the manoeuvre back. Where there is no such place it ends with IMPASSABLE at once.

Among robots that announce where they go (``mbf_abstract.traffic``), the rule ``right_of_way`` decides: the one that
goes first waits until the others have left its path; the others pull out, also off the path that the first one has
announced, and wait until it has passed. Both wait while the others move, and ``longest_wait`` longer; for others that
come to no new place not more than ``MOST_WAITS`` times as long in all, so a slow one has the time that it takes. One
that finds no place, or does not get there, announces that, and then goes first. One that goes first and has waited in
vain announces that, too: then the others go first, and it pulls out itself. Robots that stand without a goal in its way
are asked to pull out and waited for; run by such a robot, ``give_way`` only pulls out (see ``server.making_room``). In
the end the maps forget what they keep of places where the others stood and have left.

The server's ``recovery_patience`` must leave time for drive and wait.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.pull_out import in_plane_of, paths_beside, paths_to_keep_free
from mbf_abstract.maps.recoveries.left_path import LeftPath
from mbf_abstract.maps.recoveries.pulling_out import PullingOutParameters, PullingOutRecovery
from mbf_abstract.maps.recoveries.wait import stand
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.right_of_way import right_of_way

WAIT_PERIOD = 0.5  # s between two looks at where the other robots are
MOVED = 0.2  # m, of another robot that does not stand
MOST_WAITS = 3.0  # times longest_wait, for robots that move again and again and come to no new place
NOT_THERE = frozenset([RecoveryOutcome.IMPASSABLE, RecoveryOutcome.PAT_EXCEEDED])
"""How it ends to find no place, or not to get there."""


class GiveWayParameters(PullingOutParameters):
    """Parameters of ``give_way``."""

    wait: float = parameter(3.0, "How long to stand there, at least.", unit="s", ge=0.0, le=600.0)
    random_extra: float = parameter(3.0, "Stand up to this much longer, by chance.", unit="s", ge=0.0, le=600.0)
    longest_wait: float = parameter(
        8.0,
        "How long to wait for robots that announce where they go and stand; three times as long for those that move to "
        "and fro, as long as it takes for those that come on.",
        unit="s",
        ge=0.0,
        le=600.0,
    )


class GiveWayRecovery(PullingOutRecovery):
    """Pulls out, and waits until the other one may have passed."""

    Parameters: ClassVar[type[PluginParameters]] = GiveWayParameters
    parameters: GiveWayParameters
    _left: tuple[Pose, LeftPath] | None = None
    """Where it has set out to pull out, and the path that it left there; None among robots that go first."""
    _track: FloatArray
    """What it had driven by then (n, 3) [m]; to pull out is no part of its path."""

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Pull out and wait, or wait first, where the right of way is this robot's; then forget where others stood."""
        if self.traffic.own is not None and self.traffic.own.makes_room:
            return self.make_room(request)
        rivals = self.rivals()
        result = self._yield_or_wait(request, rivals)
        with suppress(RobotStateError):  # what was done is done; whoever drives next needs the pose as well
            self._forget_left_places(request.motion.pose(), rivals)
        return result

    def _yield_or_wait(self, request: RecoveryRequest, rivals: Sequence[Announcement]) -> RecoveryResult:
        if rivals and not self._before(rivals):
            result = self._ask_for_room(request, rivals)
            rivals = self.rivals()
            if not (result.success and rivals):
                return result
            if all(rival.makes_room for rival in rivals):  # to pull out for those that go nowhere is of no use
                return replace(result, outcome=RecoveryOutcome.IMPASSABLE)
            if not self._before(rivals):
                self.traffic.wait_was_in_vain(rivals)
        before = self._before(rivals)
        self.traffic.yields = True
        begin, self._track = request.motion.pose(), self.robot.recent_track()
        left = LeftPath(self.navigation_map, self.on_map(begin), self.parameters.distance, self.clock.now())
        self._left = None if before else (begin, left)
        try:
            result = self.pull_out(request, self._keep_free, "its path", self.distance_to(before))
            if result.success:
                return self._stand_aside(request, begin, before, left)
        finally:
            self.traffic.yields, self._left = False, None
        return self._without_room(request, before, result) if result.outcome in NOT_THERE else result

    def _ask_for_room(self, request: RecoveryRequest, rivals: Sequence[Announcement]) -> RecoveryResult:
        """Wait for the others, and have those among them that stand without a goal pull out."""
        self.traffic.ask(any(rival.makes_room for rival in rivals))
        try:
            return self._wait_for(request, rivals, "has the right of way over")
        finally:
            self.traffic.ask(False)

    def drive(
        self,
        request: RecoveryRequest,
        velocity: Callable[[Pose], Twist | RecoveryResult],
        finished: Callable[[Pose], bool] = lambda _: False,
        obstacle_ahead: Callable[[Pose, Twist], str] | None = None,
    ) -> RecoveryResult:
        """As every recovery; over where they drive on for whom it leaves its path, who may also pass meanwhile."""

        def looks_and_finished(pose: Pose) -> bool:
            if self._left is None:
                return finished(pose)
            (begin, left), place, now = self._left, self.on_map(pose), self.clock.now()
            left.look(place, now)
            return (left.is_free_again(place, now) and self.turns_to(begin, pose)) or finished(pose)

        return super().drive(request, velocity, looks_and_finished, obstacle_ahead)

    def _stand_aside(
        self, request: RecoveryRequest, begin: Pose, before: list[Announcement], left: LeftPath
    ) -> RecoveryResult:
        """Wait beside the path, until the robots that go first have passed; go back where it cannot turn to it."""
        p, place = self.parameters, request.motion.pose()
        if before:
            result = self._wait_for(request, before, f"has pulled out at ({place.x:.2f}, {place.y:.2f}) for")
        else:
            result = self._stand_until_clear(request, left, p.wait + p.random_extra * float(self.rng.random()))
        if not result.success or self.turns_to(begin, request.motion.pose()):
            return result
        back = self.drive_back(request, partial(self.turns_to, begin))
        text = f"{result.message}; drove back, as it cannot turn there{back.message and f': {back.message}'}"
        return replace(back if request.cancel_token.cancelled else result, message=text)

    def _stand_until_clear(self, request: RecoveryRequest, left: LeftPath, duration: float) -> RecoveryResult:
        """Stand for a time [s]; less, where somebody was seen on the path that it left, and is gone or drives on."""
        pose = request.motion.pose()
        place, begun, result, why = self.on_map(pose), self.clock.now(), RecoveryResult(0), "beside its path"
        while result.success and (still := begun + duration - (now := self.clock.now())) > 0.0:
            present = left.look(place, now)
            if left.is_free_again(place, now):
                why = "until who stood ahead drove on"
                break
            if left.seen and not present:
                break
            result = stand(request, min(still, WAIT_PERIOD))
        waited = f"waited {self.clock.now() - begun:.3g} s at ({pose.x:.2f}, {pose.y:.2f}), {why}"
        return replace(result, message=waited) if result.success else result

    # --------------------------------------------------------------------------------------------- the other robots
    def _before(self, rivals: Sequence[Announcement]) -> list[Announcement]:
        """Those of the robots that go before this one."""
        own = self.traffic.own
        return [rival for rival in rivals if own is not None and not right_of_way(own, rival)]

    def _wait_for(self, request: RecoveryRequest, rivals: Sequence[Announcement], why: str) -> RecoveryResult:
        """Stand until none of these robots blocks it, or the turn is another's, or they stand for too long."""
        names, begun = {rival.name for rival in rivals}, self.clock.now()
        went_before = {rival.name for rival in self._before(rivals)}
        been, longest = {rival.name: [rival.path[0]] for rival in rivals}, self.parameters.longest_wait
        moved = came_on = begun
        while self.clock.now() < min(moved + longest, came_on + MOST_WAITS * longest):
            result = stand(request, WAIT_PERIOD)
            if not result.success:
                return result
            left = [rival for rival in self.rivals() if rival.name in names]
            if not left or {rival.name for rival in self._before(left)} - went_before:
                break
            for rival in left:
                off = norm(np.array(been[rival.name]) - rival.path[0])
                if off[-1] > MOVED:
                    moved = self.clock.now()
                    came_on = moved if off.min() > MOVED else came_on
                    been[rival.name].append(rival.path[0])
        text = f"{why} {', '.join(sorted(names))}; waited {self.clock.now() - begun:.1f} s"
        return RecoveryResult(RecoveryOutcome.SUCCESS, text)

    def _without_room(
        self, request: RecoveryRequest, before: list[Announcement], failed: RecoveryResult
    ) -> RecoveryResult:
        """Announce that this robot has failed to pull out, so that the others yield, and wait for them."""
        if not before:
            return failed
        self.traffic.set_cannot_yield(True)
        result = self._wait_for(request, before, f"{failed.message}; asks for the right of way over")
        return replace(result, outcome=failed.outcome) if result.success and self.rivals() else result

    def _forget_left_places(self, pose: Pose, rivals: Sequence[Announcement]) -> None:
        """Free what the maps keep of the bodies of robots that have left: no ray passes all of these cells."""
        now, size = self.clock.now(), self.parameters.distance
        present = {other.name: other.path[0] for other in self.traffic.others(now)}
        known = [rival for rival in rivals if rival.name in present and rival.radius > 0.0]
        left = [one for one in known if all(norm(there - one.path[0]) > size for there in present.values())]
        for one in (self.maps.values() or [self.navigation_map]) if left else ():
            for rival in left:
                x, y, z = rival.path[0].tolist()
                place = Pose.planar(x, y, z=z, frame_id=pose.frame_id)
                one.clear_area(self.on_map(place, one), 2.0 * rival.radius)
            one.update(self.on_map(pose, one), now)

    # -------------------------------------------------------------------------------------------------- the search
    def _keep_free(self, begin: Pose, course: Pose) -> Iterator[FloatArray]:
        """Yield its path and those of others, in the plane of the robot at ``begin``; see ``paths_beside``.

        Its path leads on as the robot stood at ``course``, before it set out to a place that is not free any more.
        """
        rivals = self.rivals()
        before = self._before(rivals)
        distance = self.distance_to(before)
        length = self.parameters.reach + distance
        paths = [rival.points_ahead(length) for rival in before]
        own = paths_to_keep_free(course, self._track, paths, length)
        known = () if rivals else self.navigation_map.tracked_objects(self.clock.now())
        free = paths_beside(self.on_map(course), own, known, distance, self.navigation_map.same_storey)
        return (in_plane_of(begin, course, points) for points in free)
