"""A scenario, ready to be driven by your own script: world, robot, server and navigator on one simulated clock.

``mbf run`` is this plus an executive that visits the goals, and the results on disk.

Example
-------
>>> with Session("outdoor", SessionOptions(backend="mesh")) as session:
...     plan = session.navigator.get_path(session.goals[0])
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.objects import TrackedObject
from mbf_abstract.server.map_server import MapServer
from terrain.physics.actors import Fellow
from terrain.physics.command_delay import CommandDelay
from terrain.physics.incidents import ANY_COLLISION, COLLISIONS_WITH, Incident
from terrain.physics.simulation import Simulation
from terrain.provenance.named_files import InputCopies
from terrain.recording.recorded_robot import Report, RobotShape, as_mount
from terrain.recording.recorder import LOCAL_MAP_PERIOD, Recorder
from terrain.scenarios.environment import with_noise
from terrain.scenarios.faults import ODOMETRY, FaultSchedule
from terrain.scenarios.scenario import Scenario
from terrain.scenarios.sensors import AnyRobot, make_localization, make_proprioceptive_sensors, make_sensors
from terrain.scenarios.settings import apply_world_settings
from terrain.sensors.proprioception import WheelOdometryReading
from terrain.sensors.rays import FellowRays
from terrain.sensors.sensor import Sensor
from terrain.session.navigation_config import errors_in_scenario, errors_in_source, write_navigation_config
from terrain.session.simulation_session import SessionOptions, SimulationSession
from terrain.session.site import Site

__all__ = ["Session", "SessionOptions"]

SCANS_PER_RECORDED = 10
DEFAULT_OPTIONS = SessionOptions()


@dataclass(frozen=True)
class Member:
    """One robot of a site.

    Attributes
    ----------
    name : str
        Its name; the only robot of a site has none.
    """

    site: Site
    name: str = ""

    @property
    def robot(self) -> AnyRobot:
        """The robot itself."""
        return self.site.robots[self.name]

    @property
    def folder(self) -> Path:
        """Where its configuration and its results are written."""
        return self.site.folder / self.name

    @cached_property
    def fellows(self) -> dict[str, Fellow]:
        """The other robots of the site, by name."""
        return self.site.fellows_of(self.name)


class Session(SimulationSession):
    """One scenario, built and running; a context manager.

    Parameters
    ----------
    scenario : Scenario or str
        A scenario with one robot, the name of a shipped one, or a file.
    member : Member, optional
        Which of several robots in one world it is; without it the session builds the world and closes it.

    Attributes
    ----------
    inputs : InputCopies
        Copies of the files that the configuration names, in the folder of the session.

    Raises
    ------
    ConfigError
        The scenario has several robots, it has no configuration for the backend, or that is wrong; all findings.
    """

    def __init__(
        self, scenario: Scenario | str, options: SessionOptions = DEFAULT_OPTIONS, member: Member | None = None
    ) -> None:
        with errors_in_scenario(scenario) as loaded:
            self._build(loaded, options, member)

    def _build(self, loaded: Scenario, options: SessionOptions, member: Member | None) -> None:
        if loaded.robots:
            raise ConfigError([Finding(loaded.name, 1, "robots", "one robot; use a FleetSession", "several")])
        asked, settings = apply_world_settings(loaded, options.settings)
        self.scenario = with_noise(asked)
        self.backend = options.backend or self.scenario.backend
        if self.backend not in self.scenario.navigation:
            known = f"one of {', '.join(self.scenario.navigation)}"
            raise ConfigError([Finding(loaded.name, 1, "navigation", known, repr(self.backend))])
        self.seed = self.scenario.seed if options.seed is None else options.seed
        self._is_alone = member is None
        self._member = member or Member(Site(self.scenario, options, self.seed, {"": self.seed}))
        self.site, self.world = self._member.site, self._member.site.world
        self.folder = self._member.folder
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self.inputs = InputCopies(self.folder)
            self._wire(replace(options, seed=self.seed, settings=settings))
        except BaseException:
            self._close_site()
            raise

    def _wire(self, options: SessionOptions) -> None:
        """Sensors, then the server on their map, then the recorder."""
        source = self.scenario.navigation[self.backend]
        config_file = write_navigation_config(
            source, self.scenario.robot, self.world.files, self.folder, options.settings, self.inputs
        )
        self.robot = self._member.robot
        simulation = self._make_simulation()
        delay = CommandDelay(self.world.physics, self.robot.send_command, self.scenario.perturb.command_delay)
        self.recorder = self._make_recorder()
        self._scans = 0
        self._next_local_map = 0.0
        with errors_in_source(source, self.folder, options.settings):
            super().__init__(simulation, self.localization, config_file, options, delay, self.site.clock)
        self.navigator.server.get_path.listeners.append(self._record_plan)
        self.navigator.server.refine_path.listeners.append(self._record_refined_plan)
        simulation.on_incident.append(self._report_incident)
        for incident in simulation.incidents:  # of the first instant
            self._report_incident(incident)
        self.recorder.reports.mounts |= {name: as_mount(mount) for name, mount in self.sensor_mounts.items()}
        self.loop.on_sample.append(self._record_sample)
        self.loop.on_scan.append(self._record_scan)

    @property
    def goals(self) -> list[Pose]:
        """The scenario's goals on the ground."""
        return [self.world.pose_of(goal) for goal in self.scenario.goals]

    def close(self) -> None:
        """Stop the robot, the server and the simulator."""
        super().close()
        self._close_site()

    def _close_site(self) -> None:
        if self._is_alone:
            self.site.close()

    def _make_simulation(self) -> Simulation:
        fellows = self._member.fellows
        rays = [*self.site.rays, FellowRays(list(fellows.values()))] if fellows else self.site.rays
        sensors: dict[str, Sensor[Any]] = {
            **make_sensors(self.scenario.sensors, self.robot, rays, self.seed),
            **make_proprioceptive_sensors(self.scenario, self.robot, self.seed),
        }
        self.localization = make_localization(self.scenario.localization, self.robot, self.seed)
        self.faults = FaultSchedule(self.world.physics, sensors, self.localization, self.scenario.faults)
        return Simulation(self.world.physics, self.robot, sensors, self.world.actors, fellows)

    def _make_recorder(self) -> Recorder:
        shape = RobotShape.of(self.robot.spec)
        recorder = Recorder(self.scenario.name, self.backend, shape, self.robot.pose(), self.goals)
        recorder.ground, recorder.walls, recorder.obstacles = self.world.ground, self.world.walls, self.site.obstacles
        recorder.actors = [*self.world.actors, *self._member.fellows.values()]
        return recorder

    def _report_incident(self, incident: Incident) -> None:
        """Put an incident into the log, unless another event holds it: a collision has one of what was hit."""
        at_once = (other.kind for other in self.simulation.incidents if other.stamp == incident.stamp)
        if incident.kind in ANY_COLLISION and any(kind in COLLISIONS_WITH.values() for kind in at_once):
            return
        self.events.emit(EventKind.INCIDENT, "simulator", **incident.to_json())

    def _record_sample(self, time: float, pose: Pose, velocity: Twist) -> None:
        server = self.navigator.server
        self.recorder.sample(time, pose, velocity, server.runtime.gate.last_command, self._robot_report(velocity))
        self.recorder.tracked(time, self.tracked_objects)
        if time >= self._next_local_map and isinstance(server, MapServer):
            self._next_local_map = time + LOCAL_MAP_PERIOD
            self._record_surroundings(time, server)

    def _robot_report(self, velocity: Twist) -> Report:
        """What the navigation has of the robot; without a sensor of odometry the measured velocity is the true one."""
        transforms, robot = self.navigator.server.runtime.transforms, self.navigator.server.runtime.robot
        reading: WheelOdometryReading | None = self.simulation.latest.get(ODOMETRY)
        try:
            T_map_base = transforms.lookup(self.recorder.start.frame_id, robot.robot_frame)
            estimate = Pose(T_map_base.translation, T_map_base.rotation, T_map_base.parent)
        except TransformError:
            estimate = None
        if reading is None:
            return Report(estimate, None, velocity)
        return Report(estimate, reading.pose, reading.odometry.velocity)

    def _record_surroundings(self, time: float, server: MapServer) -> None:
        try:
            near = server.local_map.map
            self.recorder.reports.outline(time, near.robot_outline)
            if server.local_view:
                self.recorder.reports.local_map(time, near.frame_id, server.map_view(server.local_view))
        except Exception as error:  # as a map that refuses a scan, it must not stop the physics
            self.events.emit(EventKind.FAULT, "local_map", type=type(error).__name__, message=str(error))

    def tracked_objects(self) -> list[TrackedObject]:
        """What the map knows that the robot drives on, without starting its updates; in the frame of the world."""
        server, world = self.navigator.server, self.recorder.start.frame_id
        try:
            known = server.local_map.tracked_objects() if isinstance(server, MapServer) else ()
            return [one.seen_from(server.runtime.transforms.lookup(world, one.frame_id)) for one in known]
        except TransformError:
            return []
        except Exception as error:  # as a map that refuses a scan, it must not stop the physics
            self.events.emit(EventKind.FAULT, "tracked_objects", type=type(error).__name__, message=str(error))
            return []

    def _record_scan(self, scan: RangeScan) -> None:
        self._scans += 1
        if self._scans % SCANS_PER_RECORDED == 1:
            mounted = scan.source if scan.source in self.sensor_mounts else ""
            orientation = self.simulation.robot.pose().orientation  # sensors are mounted straight
            self.recorder.scan(scan.stamp, scan.points, scan.origin, mounted, orientation)

    def _record_refined_plan(self, handle: AnyGoalHandle) -> None:
        path = handle.result.refined_path if handle.result is not None else None
        if path is not None:
            self.recorder.path(self.simulation.time, path.positions)

    def _record_plan(self, handle: AnyGoalHandle) -> None:
        path = handle.result.path if handle.result is not None else None
        if path is not None:
            self.recorder.path(self.simulation.time, path.positions)
            server = self.navigator.server
            self.recorder.map(self.simulation.time, server.map_view, server.map_views)
