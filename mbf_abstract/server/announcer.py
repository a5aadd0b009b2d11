"""Announces to other robots where the robot of a server is and where it goes.

Example
-------
>>> announcer = Announcer(server, "anna", channel)
>>> announcer.announce()  # twice a second or so, on any thread
"""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from mbf_abstract.actions.meetings import distance_of_meetings
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import EventKind
from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.execution.plan_check import in_global_frame, path_in_global_frame
from mbf_abstract.execution.planner import FALLBACK_OUTCOMES
from mbf_abstract.geometry import Path
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.server.making_room import MakingRoom
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.traffic.announcement import DIGITS, Announcement
from mbf_abstract.traffic.right_of_way import MEETING_LENGTH
from mbf_abstract.traffic.traffic import ANOTHER_GOAL, Channel

LENGTH = 12.0
"""How much of its path [m] a robot announces."""
IDLE_TIME = 2.0
"""A robot without a goal for this long [s] goes nowhere; executives send one goal after the other."""

ASKS_FOR = 3.0
"""A plan beside a drive that fails counts for so long [s]; some executives plan only while their path is blocked."""


class Announcer:
    """Publishes for one server: the path that ``exe_path`` follows, and in recoveries the one that it has followed.

    A robot without a path announces what it wishes, see ``Traffic.wish``, until it follows another path, or its goal is
    over. One that drives asks who stands on its path for room while plans beside the drive find no path to its end.
    A robot without a goal also makes room for others that ask, see ``making_room``.

    Parameters
    ----------
    server : AbstractNavigationServer
        Its plugins know the announcements of the other robots from now on.
    name : str
        Of the robot; no other robot has it.
    """

    def __init__(self, server: AbstractNavigationServer, name: str, channel: Channel) -> None:
        self._server = server
        self._goal_id: int | None = None
        self._wished: Path | None = None
        self._tracker: PathTracker | None = None
        self._busy = -math.inf
        self._failed = -math.inf  # when the last plan beside the drive found no path
        server.runtime.traffic.connect(name, channel)
        self._making_room = MakingRoom(server)
        server.get_path.listeners.append(self._note_plan)
        for action in (server.move_base, server.recovery):
            action.listeners.append(self._end_wish)

    def announce(self) -> None:
        """Publish the present state; does nothing while the robot does not know where it is."""
        runtime = self._server.runtime
        now = runtime.clock.now()
        self._take_path(now)
        self._ask_ahead(now)
        try:
            pose = runtime.robot.pose()
        except RobotStateError:
            return
        position = pose.position
        path, remaining, destination = np.array([position]), 0.0, None
        if self._tracker is not None:
            self._tracker.update(position)
            path = np.concatenate([path, self._tracker.ahead(LENGTH)])
            remaining = float(norm(path[1] - path[0])) + self._tracker.remaining
            destination = self._tracker.points[-1]
        state = Announcement(
            "",
            now,
            path,
            round(remaining, DIGITS),
            radius=self._server.robot_radius,
            distance=distance_of_meetings(runtime, self._server.plugins),
        )
        runtime.traffic.announce(self._making_room.announced(state), destination)
        self._making_room.act(pose)

    def _take_path(self, now: float) -> None:
        """Keep up with wishes and the newest goal of ``exe_path``; without goals that drive, forget after a while."""
        server, traffic = self._server, self._server.runtime.traffic
        if traffic.wished is not self._wished:
            self._wished, self._busy = traffic.wished, now
            self._tracker = None if self._wished is None else PathTracker(self._wished)
        goals = server.exe_path.unfinished
        if goals and goals[-1].id != self._goal_id:
            self._goal_id = goals[-1].id
            traffic.wished = self._wished = None
            try:
                self._tracker = PathTracker(path_in_global_frame(goals[-1].goal.path, server.runtime))
            except TransformError:
                self._tracker = None  # exe_path ends with the same error
        if any(action.busy for action in (server.exe_path, server.recovery, server.move_base)):
            self._busy = now
        elif now - self._busy >= IDLE_TIME:
            traffic.wished = self._wished = self._tracker = None

    def _ask_ahead(self, now: float) -> None:
        """Ask who stands on the path that is driven for room while plans beside the drive find none."""
        runtime = self._server.runtime
        if not self._server.exe_path.busy:
            self._failed = -math.inf
        distance = distance_of_meetings(runtime, self._server.plugins) if now - self._failed < ASKS_FOR else 0.0
        rivals = runtime.traffic.rivals(now, distance, MEETING_LENGTH) if distance > 0.0 else ()
        asked = [rival.name for rival in rivals if rival.makes_room]
        if asked and not runtime.traffic.held_up:
            text = f"finds no path beside its drive, and asks {', '.join(asked)} for room"
            runtime.events.emit(EventKind.CUSTOM, "announcer", message=text)
        runtime.traffic.held_up = bool(asked)

    def _note_plan(self, handle: AnyGoalHandle) -> None:
        """Note whether there is a path from where the robot drives to the end of the one that it follows."""
        driven, goal, result = self._server.exe_path.unfinished, handle.goal, handle.result
        if not driven or goal.start_pose is not None or handle.status is GoalStatus.CANCELED or result is None:
            return
        with suppress(TransformError):
            ends = [in_global_frame(end, self._server.runtime) for end in (goal.target_pose, driven[-1].goal.path[-1])]
            if ends[0].distance_to(ends[1]) <= ANOTHER_GOAL:
                fails = result.plugin_outcome in FALLBACK_OUTCOMES and not result.is_final
                self._failed = self._server.runtime.clock.now() if fails else -math.inf

    def _end_wish(self, handle: AnyGoalHandle) -> None:
        """End what a robot wishes with its goal: that of ``move_base``, or of an executive, which cancels what runs."""
        if handle.action == self._server.move_base.name or handle.status is GoalStatus.CANCELED:
            self._server.runtime.traffic.wish(None)
