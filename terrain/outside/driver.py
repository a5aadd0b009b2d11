"""Lets somebody outside drive the robot of a scenario, and finds out when it has arrived.

Commands pass the velocity gate of the session: its limits hold, and the robot stops when none has come for
``command_timeout``, as the driver of a real robot should stop it. Simulated time passes as real time does. In lockstep,
the simulator waits for the command of each control period while the robot moves, so that neither is too slow for the
other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from mbf_abstract.drive.commands import stands_still
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Command, Pose, normalize_angle
from mbf_abstract.goals.result_types import MoveBaseResult
from mbf_abstract.outcomes import MoveBaseOutcome
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import TIME_RESOLUTION, Clock, WallClock
from mbf_abstract.time.pace import Pace
from terrain.session.arrival import arrival_tolerance
from terrain.session.executives import GoalExecutive
from terrain.session.goal_sequence import NO_GOALS
from terrain.session.session import Session

OWNER = "cmd_vel"
REPEAT_PERIOD = 0.1  # s of real time between two repetitions of the robot's state while the simulator waits
TIME_AT_GOAL = 3.0  # s that it must stand at a goal; whoever drives learns of it, too, while time still passes
STANDING = 0.05  # m/s, and rad/s; a robot on wheels that is slower stands


class RobotLink(Protocol):
    """What connects a simulated robot with whoever drives it; any method raises where the connection has failed."""

    def publish(self) -> None:
        """Publish time and the state of the robot."""

    def repeat(self) -> None:
        """Publish the same once more."""

    def show_goal(self, goal: Pose) -> None:
        """Publish where the scenario wants the robot to go."""

    def take(self) -> Command | None:
        """Return the newest command if one has come since the last call."""

    def wait(self, seconds: float) -> bool:
        """Wait for a command, at most ``seconds`` of real time; returns whether there is one to take."""

    def close(self) -> None:
        """End the connection."""


@dataclass(frozen=True)
class OutsideOptions:
    """How a robot is driven from outside.

    Attributes
    ----------
    open_link : callable
        Makes the connection of a session's robot.
    lockstep : bool
        While the robot moves, no more simulated time passes without a new command than one control period
        (``controller_frequency`` of the scenario's configuration) and one step of the simulator. It is not slowed
        down to real time then.
    patience : float
        After how long [s of real time] without a command to move the run ends, once there was one; each goal begins
        anew.
    wall : Clock
        Real time.
    """

    open_link: Callable[[NavigationSession], RobotLink]
    lockstep: bool = False
    patience: float = 60.0
    wall: Clock = field(default_factory=WallClock)


def outside_executive(session: Session, options: OutsideOptions) -> GoalExecutive:
    """Make an executive that waits for each goal until the robot stands there; closed with the session."""
    driver = OutsideDriver(session, options)
    return GoalExecutive(lambda planner, controller: driver)


class OutsideDriver:
    """Hands commands to the robot of a session, and judges where that leads; see ``outside_executive``."""

    def __init__(self, session: Session, options: OutsideOptions) -> None:
        runtime = session.navigator.server.runtime
        lease = runtime.gate.acquire(OWNER)
        assert lease is not None, "somebody else drives the robot"
        self._session, self._options, self._gate, self._lease = session, options, runtime.gate, lease
        self._tolerance = arrival_tolerance(session.scenario.limits, session.scenario.localization, runtime.parameters)
        self._longest = 1.0 / runtime.parameters.controller_frequency + session.rates.period
        self._wall = options.wall
        self._pace = Pace(self._wall)
        self._condition = session.clock.condition()
        self._goal: Pose | None = None
        self._result = NO_GOALS
        self._commanded = 0.0  # simulated time [s] of the last command
        self._standing_since: float | None = None  # simulated time [s]
        self._moved: float | None = None  # real time [s] of the last command to move, or of the goal after it
        self._link = options.open_link(session)
        session.on_close(self._link.close)
        session.loop.on_tick.append(self._after_step)

    def run(self, goal: Pose) -> MoveBaseResult:
        """Wait until the robot stands at a goal, or nobody drives it any more."""
        self._link.show_goal(goal)
        with self._condition:
            if self._moved is not None:
                self._moved = self._wall.now()
            self._goal, self._standing_since = goal, None
            while self._awaits():
                self._condition.wait()
            return self._result

    def cancel(self, reason: str) -> None:
        """Wait no longer; the robot stays in the hands of whoever drives it."""
        self._end(MoveBaseOutcome.CANCELED, reason)

    def _awaits(self) -> bool:
        return self._goal is not None

    # ------------------------------------------------------------------------------- on the simulator's thread
    def _after_step(self, time: float) -> None:
        self._link.publish()
        self._hold(time)
        command = self._link.take()
        if command is not None:
            self._commanded = time
            if not stands_still(command):
                self._moved = self._wall.now()
            self._lease.send(command)
        self._judge(time)

    def _hold(self, time: float) -> None:
        """Let time stand still until it may pass."""
        if not self._options.lockstep or stands_still(self._gate.last_command):
            self._pace.wait(time, 1.0)
            return
        self._pace.wait(time, 0.0)
        if time - self._commanded < self._longest - TIME_RESOLUTION:
            return
        while not self._link.wait(REPEAT_PERIOD) and self._has_patience():
            self._link.repeat()  # who hears nothing takes the robot for dead

    def _judge(self, time: float) -> None:
        goal, truth = self._goal, self._session.loop.true_pose
        if goal is None:
            return
        distance, angle = truth.distance_to(goal), abs(normalize_angle(truth.yaw - goal.yaw))
        near = distance <= self._tolerance[0] and math.degrees(angle) <= self._tolerance[1]
        if not (near and self._stands()):
            self._standing_since = None
            if not self._has_patience():
                silence = f"no command to move has come for {self._options.patience:g} s"
                self._end(MoveBaseOutcome.FAILURE, f"{silence}, and the robot is {distance:.2f} m from the goal")
        elif self._standing_since is None:
            self._standing_since = time
        elif time - self._standing_since >= TIME_AT_GOAL:
            self._end(MoveBaseOutcome.SUCCESS, "the robot stands at the goal")

    def _stands(self) -> bool:
        velocity = self._session.simulation.robot.velocity()
        slow = velocity.speed < STANDING and abs(velocity.wz) < STANDING
        return slow and stands_still(self._gate.last_command)

    def _has_patience(self) -> bool:
        return self._moved is None or self._wall.now() - self._moved <= self._options.patience

    def _end(self, outcome: MoveBaseOutcome, message: str) -> None:
        with self._condition:
            goal = self._goal
            if goal is None:
                return
            self._goal, self._result = None, self._result_at(goal, outcome, message)
            self._condition.notify_all()

    def _result_at(self, goal: Pose, outcome: MoveBaseOutcome, message: str) -> MoveBaseResult:
        try:
            pose = self._session.navigator.robot_pose()  # as the localisation has it
        except RobotStateError:
            return MoveBaseResult(outcome, message)
        return MoveBaseResult(outcome, message, pose, pose.distance_to(goal), pose.angle_to(goal))
