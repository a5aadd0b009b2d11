"""Has a robot that stands without a goal pull out for another one that is blocked by it, and drive back afterwards.

Whoever is blocked and waits for it says so in what it announces (``give_way``), with the path that it wants to follow.
A robot that has been idle for ``IDLE_TIME`` and stands in that path runs the behaviour for ``actions.meetings``, which
pulls out. Once nobody wants to pass any more it drives back, as to any other goal of ``move_base``. Where it finds no
place to pull out to it announces that for a while, and nobody waits for it.

A goal from outside comes first at any time: what runs here ends at once. Nothing here waits, so it may be called on any
thread. ``idle_makes_room`` switches it off.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mbf_abstract.actions.meetings import behavior_for_meetings, meeting_distance
from mbf_abstract.actions.sub_goals import SUB_GOAL_SLOT
from mbf_abstract.events import EventKind
from mbf_abstract.execution.plan_check import in_global_frame
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.right_of_way import MEETING_LENGTH, distance_between, paths_conflict

IDLE_TIME = 2.0
"""A robot without a goal for this long [s] stands idle; executives send one goal after the other."""
NO_PLACE_FOR = 20.0
"""Where it has found no place, a robot looks for one again after this time [s]: others may have left by then."""
MOST_RETURNS = 3
"""How often a robot tries to drive back; then it stays where it is."""
BESIDE = 0.1
"""A robot that stands this much [m] farther from the end of its last path than it may has been moved since."""


class MakingRoom:
    """What one robot does for others while it has no goal."""

    def __init__(self, server: AbstractNavigationServer) -> None:
        self._server, self._runtime = server, server.runtime
        self._goal: RecoveryGoal | MoveBaseGoal | None = None
        self._handle: AnyGoalHandle | None = None
        self._busy = -math.inf  # when it last had a goal, or was driven by somebody
        self._path_end: Pose | None = None  # where its last goal led to
        self._home: Pose | None = None  # where it drives back to
        self._returns, self._no_place_until = 0, -math.inf
        self._driving = (server.follow_waypoints, server.move_base, server.exe_path, server.recovery)
        for action in self._driving:
            action.accept_listeners.append(self._let_go_first)
            action.listeners.append(self._note_end)

    def announced(self, state: Announcement) -> Announcement:
        """Return what the robot announces of itself, with whether it makes room now, and whether it cannot."""
        if self._handle is not None and self._handle.done:
            self._note_result(self._handle)
        makes_room = self._stands_idle(state.stamp) and state.remaining == 0.0
        return replace(state, makes_room=makes_room, cannot_yield=makes_room and state.stamp < self._no_place_until)

    def act(self, pose: Pose) -> None:
        """Begin what is due, for a robot at ``pose`` that has just announced itself."""
        own, now = self._runtime.traffic.own, self._runtime.clock.now()
        if self._goal is not None or own is None or not own.makes_room:
            return
        asking = self._runtime.traffic.rivals(now, self._distance, MEETING_LENGTH)
        if asking and not own.cannot_yield:
            self._home = self._home or self._place(pose)
            names = ", ".join(one.name for one in asking)
            self._send(RecoveryGoal(self._behavior), f"stands idle in the way of {names}, which asks for room")
        elif self._home is not None and self._is_free(pose, self._home, now):
            self._send(MoveBaseGoal(self._home), "drives back to where it stood before it made room")

    # -------------------------------------------------------------------------------------------- what is the case
    def _stands_idle(self, now: float) -> bool:
        """Whether it has no goal, but that of making room, and has had none for a while; nobody drives it either."""
        if not self._runtime.parameters.idle_makes_room or not self._behavior:
            return False
        others = any(handle.goal is not self._goal for action in self._driving for handle in action.unfinished)
        if isinstance(self._goal, MoveBaseGoal):
            return False
        if others or (self._goal is None and self._runtime.gate.holder):
            self._busy, self._home = now, None
        return now - self._busy >= IDLE_TIME

    @property
    def _behavior(self) -> str:
        """Name of the recovery that pulls out; empty if there is none that can."""
        plugins = self._server.plugins
        name = behavior_for_meetings(self._runtime, plugins)
        plugin = plugins.find(PluginKind.RECOVERY, name) if name else None
        can = plugin is not None and not plugin.quarantined and hasattr(plugin.instance, "make_room")
        return name if can else ""

    @property
    def _distance(self) -> float:
        return meeting_distance(self._runtime, self._server.plugins)

    def _place(self, pose: Pose) -> Pose:
        """Where it is to stand: at the end of its path where it came to stand there, else where it is."""
        end = self._path_end
        near = self._runtime.parameters.dist_tolerance + BESIDE
        return end if end is not None and end.distance_to(pose) <= near else pose

    def _is_free(self, pose: Pose, home: Pose, now: float) -> bool:
        """Whether nobody goes where it drives back, or stands there."""
        others = self._runtime.traffic.others(now)
        back = Announcement("back", now, np.array([pose.position, home.position]), 1.0)
        apart = [(one, distance_between(self._distance, one)) for one in others]
        going = any(one.remaining > 0.0 and paths_conflict(back, one, distance, math.inf) for one, distance in apart)
        return not going and all(float(norm(one.path[0] - home.position)) > distance for one, distance in apart)

    # ---------------------------------------------------------------------------------------------- what it does
    def _send(self, goal: RecoveryGoal | MoveBaseGoal, why: str) -> None:
        self._say(why)
        self._goal = goal  # ``_let_go_first`` has to know it as one of its own
        server = self._server
        handle: AnyGoalHandle = (
            server.recovery.send(goal) if isinstance(goal, RecoveryGoal) else server.move_base.send(goal)
        )
        self._handle = handle
        if self._goal is not goal:  # another goal came just then
            handle.cancel("another goal came")

    def _note_result(self, handle: AnyGoalHandle) -> None:
        """Take up how its last goal has ended; one that somebody canceled is not tried again."""
        goal, self._goal, self._handle = handle.goal, None, None
        now, message = self._runtime.clock.now(), handle.result.message if handle.result is not None else ""
        if handle.status is GoalStatus.CANCELED:
            self._busy, self._home = now, None
        elif isinstance(goal, RecoveryGoal):
            if handle.status is not GoalStatus.SUCCEEDED:
                self._no_place_until = now + NO_PLACE_FOR
            self._say(message)
        elif handle.status is GoalStatus.SUCCEEDED or self._returns + 1 >= MOST_RETURNS:
            self._home, self._returns = None, 0
            self._say("is back" if handle.status is GoalStatus.SUCCEEDED else f"stays here: {message}")
        else:
            self._returns += 1

    def _say(self, message: str) -> None:
        self._runtime.events.emit(EventKind.CUSTOM, "making_room", message=message)

    # ------------------------------------------------------------------------------------------ goals from outside
    def _let_go_first(self, handle: AnyGoalHandle) -> None:
        """End what runs here for a goal from outside; a goal of ``move_base`` takes over the drive back."""
        goal, own = self._goal, self._handle
        returning = isinstance(goal, MoveBaseGoal)
        if handle.goal is goal or (returning and getattr(handle.goal, "concurrency_slot", 0) == SUB_GOAL_SLOT):
            return
        self._goal, self._handle, self._home, self._returns = None, None, None, 0
        self._path_end, self._busy = None, self._runtime.clock.now()
        takes_over = returning and handle.action in (self._server.move_base.name, self._server.follow_waypoints.name)
        if own is not None and not own.done and not takes_over:
            own.cancel("another goal came")
            self._runtime.gate.revoke("another goal came")

    def _note_end(self, handle: AnyGoalHandle) -> None:
        """Note when a goal from outside has ended, and where the path led that was followed to its end."""
        if self._goal is not None:
            return
        self._busy = self._runtime.clock.now()
        if not isinstance(handle.goal, ExePathGoal) or handle.status is not GoalStatus.SUCCEEDED:
            return
        try:
            self._path_end = in_global_frame(handle.goal.path[-1], self._runtime)
        except TransformError:
            self._path_end = None
