"""One drive of an environment: a session whose robot is driven from outside instead of by a controller.

World, sensors, faults, map, planner and velocity gate are those of ``mbf run`` with the same scenario and seed; the
verdict is that of ``terrain.recording.verdict``. Plans are made as often as ``planner_frequency`` says. Recoveries
are not run, nor is anything slowed down before what moves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from enum import Enum
from typing import cast

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist, normalize_angle
from mbf_abstract.geometry.tilt import tilt_of
from mbf_abstract.goals.result_types import MoveBaseResult
from mbf_abstract.outcomes import MoveBaseOutcome
from mbf_abstract.server.map_server import MapServer
from mbf_abstract.time.clock import TIME_RESOLUTION
from terrain.learning.observation import Observation, ObservationParameters, Observer
from terrain.physics.incidents import IncidentKind
from terrain.recording.verdict import Verdict, judge
from terrain.scenarios.limits import broken_limits
from terrain.scenarios.scenario import Scenario
from terrain.session.arrival import Arrival
from terrain.session.robot_run import judged_numbers
from terrain.session.session import Session, SessionOptions

OWNER = "environment"  # of the lease of the velocity gate


class Ending(Enum):
    """How an episode has ended, or that it has not."""

    NOT_YET = ""
    ARRIVED = "arrived"
    CONTACT = "contact"
    TIPPED_OVER = "tipped_over"
    LIMIT = "limit"
    TIME = "time"


class Episode:
    """A session with the robot at its start, sensors and maps alive, and the first plan made.

    Parameters
    ----------
    scenario : Scenario
        With one robot.
    options : SessionOptions
        Backend, seed and settings.
    control_period : float
        Length of a step [s].

    Raises
    ------
    ConfigError
        The configuration is wrong; all findings.
    RobotStateError
        The localisation is silent from the start.
    ValueError
        A part of the observation cannot be had in this scenario on this map, or the velocity gate would stop the robot
        before the end of a step.
    """

    def __init__(
        self, scenario: Scenario, options: SessionOptions, observed: ObservationParameters, control_period: float
    ) -> None:
        self.session = Session(scenario, options)
        self._control_period = control_period
        try:
            self._begin(observed)
        except BaseException:
            self.session.close()
            raise

    def _begin(self, observed: ObservationParameters) -> None:
        session, server = self.session, cast(MapServer, self.session.navigator.server)
        if observed.scan_sectors and not session.scenario.sensors:
            raise ValueError(f"scan_sectors: expected 0 in {session.scenario.name!r}, which has no lidar")
        runtime = self._runtime = server.runtime
        if self._control_period > runtime.gate.command_timeout:
            limit = f"at most the command_timeout of the configuration, {runtime.gate.command_timeout:g} s"
            raise ValueError(f"control_period: expected {limit}, got {self._control_period:g} s")
        driven_on = server.local_map.map
        self._observer = Observer(observed, driven_on, runtime.transforms, server.scans)
        self._makes_plans = observed.waypoints > 0
        self._goals = session.goals
        self._arrivals: list[Arrival] = []
        self._is_at_last_goal = False
        self._max_tilt, self._driven, self._last_sample = 0.0, 0.0, self.true_pose
        session.loop.on_sample.append(self._take_sample)
        session.run()
        self._known = runtime.robot.pose(), runtime.robot.velocity()
        lease = runtime.gate.acquire(OWNER)
        assert lease is not None, "nobody else drives in an episode"
        self._lease = lease
        self._plan_to_goal(is_new=True)
        self._way_left = self._measured_way()

    # ----------------------------------------------------------------------------------------------- driving
    @property
    def time(self) -> float:
        """Simulated time [s] since the world was made."""
        return self.session.simulation.time

    @property
    def true_pose(self) -> Pose:
        """Ground truth of the robot."""
        return self.session.loop.true_pose

    def drive(self, command: Twist) -> float:
        """Send a command and let a step's time pass; return by how much the distance left has become shorter [m].

        The distance left is the rest of the plan and the distance from it; it also changes with the plan, so that the
        sum over an episode with one goal is the first distance less the last one. What the simulation raises is raised
        here.
        """
        session = self.session
        if self._replan_at <= session.clock.now() + TIME_RESOLUTION:  # as in a run: the next command is on the new plan
            self._plan_to_goal(is_new=False)
        self._lease.send(command)
        session.clock.sleep(self._control_period)
        if session.loop.failure is not None:
            raise session.loop.failure
        before, self._way_left = self._way_left, self._measured_way()
        gained = before - self._way_left
        self._take_arrival()
        return gained

    def _measured_way(self) -> float:
        """Length [m] of the plan that is left for the robot in truth, and its distance from the plan."""
        self._way.update(self.true_pose.position[: self._observer.dimensions])
        return self._way.remaining + self._way.deviation

    def observe(self) -> Observation:
        """Return the present observation."""
        return self._observer.observe(*self._state())

    def _state(self) -> tuple[Pose, Twist]:
        """Estimated pose and measured velocity; the last known ones where the localisation has fallen silent."""
        robot = self._runtime.robot
        with suppress(RobotStateError):
            self._known = robot.pose(), robot.velocity()
        return self._known

    def close(self) -> None:
        """Stop the robot and free the world; idempotent."""
        self.session.close()

    def _plan_to_goal(self, is_new: bool) -> None:
        """Plan; without a plan the last one to this goal stays, or else the straight line is one."""
        goal, rate = self._goals[0], self._runtime.parameters.planner_frequency
        again = self._makes_plans and rate > 0.0
        self._replan_at = self.session.clock.now() + 1.0 / rate if again else math.inf
        path = self._planned(goal) if self._makes_plans else None
        if path is None and is_new:
            path = Path.from_points([self._state()[0].position, goal.position], goal.orientation)
        if path is not None:
            self._observer.set_plan(path)
            assert self._observer.tracker is not None
            self._way = PathTracker(self._observer.tracker.path, self._observer.dimensions)

    def _planned(self, goal: Pose) -> Path | None:
        """What the planner and, if the configuration names one, the refiner make of the path to a goal."""
        navigator = self.session.navigator
        path = navigator.get_path(goal).path
        if path is None or not len(path):
            return None
        refiner = self._runtime.parameters.plan_refiner
        refined = navigator.refine_path(path, refiner=refiner).refined_path if refiner else None
        return path if refined is None else refined

    def _take_arrival(self) -> None:
        """Go on to the next goal once the plan is driven to its end and the robot is there by its estimated pose."""
        parameters, goal = self._runtime.parameters, self._goals[0]
        pose, _ = self._state()
        if not self._observer.has_arrived(pose, parameters.dist_tolerance, parameters.angle_tolerance):
            return
        distance, angle = pose.distance_to(goal), abs(normalize_angle(pose.yaw - goal.yaw))
        result = MoveBaseResult(MoveBaseOutcome.SUCCESS, "", pose, distance, angle)
        self._arrivals.append(Arrival.at(goal, self.true_pose, result))
        if len(self._goals) > 1:
            del self._goals[0]
            self._plan_to_goal(is_new=True)
            self._way_left = self._measured_way()
        else:
            self._is_at_last_goal = True

    # ----------------------------------------------------------------------------------------------- judging
    def ending(self, time_limit: float) -> Ending:
        """Whether the judge ends the episode now; ``time_limit`` is in simulated seconds."""
        counts = self.session.simulation.monitor.counts
        if counts[IncidentKind.COLLISION_WHILE_MOVING]:
            return Ending.CONTACT
        if counts[IncidentKind.TIPPED_OVER]:
            return Ending.TIPPED_OVER
        if broken_limits(self.session.scenario.limits, self._metrics()):
            return Ending.LIMIT
        if self._is_at_last_goal:
            return Ending.ARRIVED
        return Ending.TIME if self.time >= time_limit else Ending.NOT_YET

    def verdict(self, ending: Ending) -> Verdict:
        """Return the judge's verdict on an episode that ends so."""
        arrived = ending is Ending.ARRIVED
        outcome = MoveBaseOutcome.SUCCESS if arrived else MoveBaseOutcome.FAILURE
        return judge(MoveBaseResult(outcome, ending.value), self.session.scenario.limits, self._metrics())

    def _take_sample(self, time: float, pose: Pose, velocity: Twist) -> None:
        """Tilt and length of a run are those of its recording, so they are taken from its samples."""
        self._max_tilt = max(self._max_tilt, tilt_of(pose))
        self._driven += pose.distance_to(self._last_sample)
        self._last_sample = pose

    def _metrics(self) -> Mapping[str, object]:
        """What the judge looks at, as it stands in ``metrics.json`` of a run."""
        return {
            **judged_numbers(self.session, self._arrivals),
            "max_tilt_deg": round(math.degrees(self._max_tilt), 6),
            "path_length_m": round(self._driven, 6),
        }
