"""What the robots of a scenario share: the world, the clock and the folder; and where each of them stands in it."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.geometry import Pose
from mbf_abstract.time.clock import Clock, WallClock
from mbf_abstract.time.sim_clock import SimClock
from terrain.physics.actors import Fellow
from terrain.physics.contact_depth import placed
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.motion_sample import Thing
from terrain.physics.protocols import PlacedRobot
from terrain.physics.robot_models import Drive, RobotSpec
from terrain.physics.robots import WheeledRobot
from terrain.scenarios.environment import build_environment
from terrain.scenarios.perturbation import DrawnError, draw_disturbance
from terrain.scenarios.scenario import Scenario, robot_scenarios
from terrain.scenarios.sensors import AnyRobot, ray_casters
from terrain.session.simulation_session import SessionOptions
from terrain.urdf_robots.omni_robot import OmniRobot
from terrain.urdf_robots.robot_choice import simulated_spec, spec_of


class Site:
    """The world of a scenario with its robots, standing; ``close`` frees it.

    Parameters
    ----------
    options : SessionOptions
        Folder, clock and ``on_step``.
    seeds : mapping of str to int
        Of each robot, which draws from it how its start is disturbed.
    seed : int
        Of the world.

    Attributes
    ----------
    world : ScenarioWorld
    obstacles : Surface or None
        What is on no map, for pictures.
    clock : Clock
    folder : Path
        With the world's map files.
    robots : dict of str to AnyRobot
        By the names of ``robot_scenarios``.
    rays : list of RayCaster
        What sensors see in the world, beside other robots.

    Raises
    ------
    ConfigError
        A place is unknown, or two robots would stand in one place.
    """

    def __init__(self, scenario: Scenario, options: SessionOptions, seed: int, seeds: Mapping[str, int]) -> None:
        self.clock: Clock = WallClock() if options.wall_clock else SimClock()
        self._temporary = tempfile.TemporaryDirectory(prefix="mbf_session_")  # removed with the site, used or not
        self.folder = Path(self._temporary.name if options.folder is None else options.folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        try:
            options.on_step("building the world")
            self.world, self.obstacles = build_environment(scenario, self.folder, seed)
        except BaseException:
            self._temporary.cleanup()
            raise
        try:
            self._stand_robots(scenario, seeds)
        except BaseException:
            self.close()
            raise

    def _stand_robots(self, scenario: Scenario, seeds: Mapping[str, int]) -> None:
        self.robots = {name: self._robot(name, view, seeds[name]) for name, view in robot_scenarios(scenario).items()}
        _refuse_overlaps(scenario, self.robots)
        first = next(iter(self.robots.values()))
        first.settle()  # it is the world that settles
        for name, robot in self.robots.items():
            if isinstance(robot, WheeledRobot):
                self.world.physics.things[robot.body] = Thing.ROBOT
            else:
                robot.fellows = list(self.fellows_of(name).values())
        self.world.introduce(list(self.robots.values()))
        self.rays = ray_casters(self.world)

    def _robot(self, name: str, scenario: Scenario, seed: int) -> AnyRobot:
        physics = self.world.physics
        disturbance = draw_disturbance(scenario.perturb, seed)
        assert scenario.start is not None  # of a scenario with one robot
        pose = disturbance.moved(scenario.start, self.world.pose_of)
        if isinstance(physics, KinematicWorld):
            return KinematicRobot(physics, spec_of(scenario.robot), pose)
        spec = simulated_spec(scenario.robot, self.folder, name or "robot")
        body = OmniRobot if spec.drive is Drive.HOLONOMIC else WheeledRobot
        return body(physics, spec, pose, friction=disturbance.friction, mass_factor=disturbance.mass)

    def fellows_of(self, name: str) -> dict[str, Fellow]:
        """Return the other robots, as the robot of this name meets them, by their names."""
        return {other: Fellow(robot) for other, robot in self.robots.items() if other != name}

    def close(self) -> None:
        """Free the world."""
        self.world.physics.close()
        self._temporary.cleanup()


@dataclass(frozen=True)
class StartingRobot:
    """A robot where it is going to start, before its world is simulated."""

    spec: RobotSpec
    start: Pose

    def pose(self) -> Pose:
        """Pose of base_link in map."""
        return self.start


def overlapping_starts(robots: Mapping[str, PlacedRobot]) -> list[Finding]:
    """Return a finding for each two robots whose outlines overlap; they come in the order of the scenario."""
    findings = []
    names = list(robots)
    for number, name in enumerate(names):
        pose = robots[name].pose()
        corners = placed(robots[name].spec.footprint_array(), pose.x, pose.y, pose.yaw)
        for other in names[:number]:
            fellow = Fellow(robots[other]).solid()
            apart = abs(fellow.pose.z - Fellow(robots[name]).pose().z)
            if apart < fellow.size[-1] and fellow.gap(corners) == 0.0:
                key, at = f"robots[{number}].start", f"({pose.x:.2f}, {pose.y:.2f})"
                findings.append(Finding("scenario", 1, key, f"a place that {other!r} does not stand in", at))
    return findings


def _refuse_overlaps(scenario: Scenario, robots: Mapping[str, AnyRobot]) -> None:
    findings = overlapping_starts(robots)
    if findings:
        drawn = any(robot.perturb.start_position for robot in robot_scenarios(scenario).values())
        raise (DrawnError if drawn else ConfigError)(findings)
