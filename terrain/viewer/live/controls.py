"""The commands of the page to a run: a new goal, an end, a pause, other plugins, a fault.

Threads of the page call ``post`` and nothing else. The simulator's thread calls ``work_off`` between two steps of the
world; everything that is asked for happens there, while no other thread of the run works.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from enum import Enum
from functools import cached_property
from typing import TypeAlias

import numpy as np

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.pace import Pace
from terrain.scenarios.faults import LocalizationJump, SensorFault
from terrain.sensors.rays import StaticRays
from terrain.session.goal_sequence import AskedGoal, AskedWaypoints, GoalSequence
from terrain.session.session import Session

MAX_WAITING = 100  # commands; a page that sends more between two steps loses the oldest
MAX_RANGE = 1e4  # m from the camera to the ground
MAX_WAYPOINTS = 100
Ray: TypeAlias = tuple[FloatArray, FloatArray]
"""Origin (3,) and direction (3,) [m]."""


class Placing(str, Enum):
    """What a click or a drag on the ground is."""

    GOAL = "a goal"
    WAYPOINT = "a waypoint"
    NOTHING = "nothing"


class LiveControls:
    """Carries commands from the page to the run.

    Parameters
    ----------
    source, place : str
        What is served: the source of events about what was asked for, and its name in texts.

    Attributes
    ----------
    planner, controller : str
        Plugins for the goals to come; empty = the first ones loaded.
    holding : bool
        Whether goals are paused, those to come as well.
    by_hand : bool
        Whether somebody drives by hand, so that no goal may drive.
    placing : Placing
    waypoints : tuple of Pose
        Those that were placed.
    """

    def __init__(
        self, session: Session, sequence: GoalSequence, source: str = "live_view", place: str = "the live view"
    ) -> None:
        self.planner = ""
        self.controller = ""
        self.holding = False
        self.by_hand = False
        self.placing = Placing.GOAL
        self.waypoints: tuple[Pose, ...] = ()
        self._session = session
        self._sequence = sequence
        self._source, self._place = source, place
        self._server = session.navigator.server
        self._pace = Pace(WallClock())
        self._waiting: deque[Callable[[], None]] = deque(maxlen=MAX_WAITING)

    def post(self, command: Callable[[], None]) -> None:
        """Have ``command`` called between two steps of the world; from any thread, never waits."""
        self._waiting.append(command)

    def work_off(self) -> None:
        """Carry out the commands that have come; on the simulator's thread."""
        while self._waiting:
            command = self._waiting.popleft()
            try:
                command()
            except Exception as error:  # a wrong request of a page must not end the run
                self._log("refused", message=f"{type(error).__name__}: {error}")
        if self.holding:
            self._server.pause_all()  # in every step, for goals that an executive has sent since the last one
        if self.by_hand:
            self._cancel_for_teleoperation()  # likewise

    def keep_pace(self, time: float, speed: float) -> None:
        """Wait as long as the run, at ``time`` [s], is ahead of so many simulated seconds per second; 0 = never.

        A run that waits for a goal goes on in real time. A wall clock needs no pacing.
        """
        if isinstance(self._session.clock, WallClock):
            speed = 0.0
        elif speed == 0.0 and self._sequence.is_waiting:
            speed = 1.0
        self._pace.wait(time, speed)

    # ------------------------------------------------------------------------------- commands, to be posted
    def place(self, ray: Ray, facing: Ray | None = None) -> None:
        """Make a goal or a waypoint, depending on ``placing``, where a ray hits the ground.

        Parameters
        ----------
        facing : Ray, optional
            Through what the robot is to face there; without it, it faces on from where it comes.
        """
        if self.placing is Placing.NOTHING:
            return
        place = self.ground_at(*ray)
        if place is None:
            self._log("there is no ground where the click was")
            return
        x, y, z = place.tolist()
        along = self.waypoints and self.placing is Placing.WAYPOINT
        before = self.waypoints[-1] if along else self._session.simulation.robot.pose()
        yaw = math.atan2(y - before.y, x - before.x) if facing is None else _yaw_towards(place, *facing)
        pose = Pose.planar(x, y, yaw, z)
        self.go_to_pose(pose) if self.placing is Placing.GOAL else self.add_waypoint(pose)

    def go_to_pose(self, goal: Pose) -> None:
        """Go there.

        Raises
        ------
        ValueError
            Somebody drives by hand.
        """
        self._check_nobody_drives()
        self._log("new goal", x=round(goal.x, 3), y=round(goal.y, 3), z=round(goal.z, 3), yaw=round(goal.yaw, 3))
        self._sequence.go_to(AskedGoal(goal, self.planner, self.controller))

    def add_waypoint(self, waypoint: Pose) -> None:
        """Add one to the list.

        Raises
        ------
        ValueError
            The list is full.
        """
        if len(self.waypoints) >= MAX_WAYPOINTS:
            raise ValueError(f"there are {MAX_WAYPOINTS} waypoints already")
        self.waypoints = (*self.waypoints, waypoint)

    def remove_waypoint(self, number: int) -> None:
        """Take the one of a number, counted from 1, off the list, if there is one; those after it move up."""
        self.waypoints = tuple(one for index, one in enumerate(self.waypoints, 1) if index != number)

    def clear_waypoints(self) -> None:
        """Empty the list; a sequence that is driven goes on."""
        self.waypoints = ()

    def drive_waypoints(self, loops: int = 1) -> None:
        """Visit the waypoints in their order instead of the present goal, so many times.

        Raises
        ------
        ValueError
            There are none, or somebody drives by hand.
        """
        self._check_nobody_drives()
        if not self.waypoints:
            raise ValueError("there are no waypoints to drive")
        self._log("drive waypoints", waypoints=len(self.waypoints), loops=loops)
        self._sequence.go_to(AskedWaypoints(self.waypoints, loops, self.planner, self.controller))

    def cancel(self) -> None:
        """Cancel the present goal, or the waypoints that are driven."""
        self._log("cancel")
        self._sequence.cancel(f"canceled in {self._place}")

    def take_over(self) -> None:
        """Cancel what drives the robot, and what would begin to, because somebody drives it by hand."""
        self._log("teleoperation")
        self.by_hand = True
        self._cancel_for_teleoperation()

    def note_end_of_teleoperation(self, reason: str) -> None:
        """Allow goals again, and log why nobody drives the robot by hand any more."""
        self.by_hand = False
        self._log("end of teleoperation", reason=reason)

    def hold(self, holding: bool) -> None:
        """Pause all goals, or let them go on."""
        self._log("pause" if holding else "resume")
        self.holding = holding
        if not holding:
            self._server.resume_all()

    def choose(self, planner: str, controller: str) -> None:
        """Use these plugins for the goals to come."""
        self.planner, self.controller = planner, controller

    def inject(self, fault: SensorFault | LocalizationJump) -> None:
        """Let a fault happen."""
        self._log("fault", **fault.model_dump())
        self._session.faults.add(fault)

    def end(self, reason: str) -> None:
        """End the run."""
        self._log("end", reason=reason)
        self._sequence.end(reason)

    # -----------------------------------------------------------------------------------------------------
    def ground_at(self, origin: FloatArray, direction: FloatArray) -> FloatArray | None:
        """Place (3,) [m] where a ray first hits the ground; None where it does not."""
        origin, direction = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        direction = direction / np.linalg.norm(direction)
        distance = float(self.ground_rays.distances(origin[None], direction[None], MAX_RANGE)[0])
        return origin + distance * direction if math.isfinite(distance) else None

    @cached_property
    def ground_rays(self) -> StaticRays:
        """Rays at the ground of the world."""
        return StaticRays(*self._session.world.ground)

    def _check_nobody_drives(self) -> None:
        if self.by_hand:
            raise ValueError("somebody drives the robot by hand: a goal can be set once the stick is released")

    def _cancel_for_teleoperation(self) -> None:
        self._sequence.cancel(f"teleoperation in {self._place}")

    def _log(self, what: str, **facts: object) -> None:
        """Log what a visitor has done to the run."""
        self._session.events.emit(EventKind.CUSTOM, self._source, what=what, **facts)


def _yaw_towards(place: FloatArray, origin: FloatArray, direction: FloatArray) -> float:
    """Heading [rad] from a place (3,) to where a ray comes to its height, or to the far end of one that never does."""
    origin, direction = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
    drop = float(origin[2] - place[2])
    sinks = float(direction[2]) * drop < 0.0
    end = origin + (-drop / direction[2] if sinks else MAX_RANGE) * direction
    return math.atan2(float(end[1] - place[1]), float(end[0] - place[0]))
