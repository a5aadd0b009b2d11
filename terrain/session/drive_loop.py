"""The thread that steps a simulation on a clock and feeds what it yields to a server and a recorder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Command, Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.clock import ClockThread, Priority, WallClock
from terrain.physics.simulation import Simulation
from terrain.recording.recorder import Recorder
from terrain.recording.run_digest import RunDigest
from terrain.scenarios.faults import ODOMETRY, seen_from
from terrain.sensors.proprioception import Localization, WheelOdometryReading

PERIOD = 1.0 / 60.0  # s between two publications of the robot's pose
TICKS_PER_SAMPLE = 6  # 10 samples a second are recorded and reported
SCANS_PER_RECORDED = 10
STOP_TIMEOUT = 2.0  # s

Report = Callable[[float, Pose, float], None]


class ClockedRobot:
    """The simulated robot as the server sees it: its odometry is stamped with the server's clock.

    Parameters
    ----------
    send : callable
        Takes the commands for its motors.
    measure : callable
        Returns its odometry, stamped with the world's time.
    digest : RunDigest
        Takes every command.
    min_turning_radius : float
        Its tightest curve [m]; 0 = it turns on the spot.
    """

    def __init__(
        self,
        send: Callable[[Command], None],
        measure: Callable[[], Odometry],
        digest: RunDigest,
        min_turning_radius: float,
    ) -> None:
        self.min_turning_radius = min_turning_radius
        self._send = send
        self._measure = measure
        self._digest = digest
        self.time_offset = 0.0

    def send_command(self, command: Command) -> None:
        """Hand the command to the simulated motors."""
        self._digest.command(command)
        self._send(command)

    def odometry(self) -> Odometry:
        """Measured velocity; the stamp is the clock's time, not the simulation's."""
        measured = self._measure()
        return Odometry(measured.velocity, measured.stamp + self.time_offset)


class DriveLoop:
    """Steps the simulator up to the clock's time, 60 times a second; publishes pose and scans.

    Parameters
    ----------
    simulation : Simulation
    robot : ClockedRobot
    localization : Localization
        Where the robot believes to be; its pose is what the server gets.
    server : AbstractNavigationServer
        Gets the scans; its clock drives the loop.
    recorder : Recorder
    digest : RunDigest
        Takes the true pose after every step.

    Attributes
    ----------
    true_pose : Pose
        Ground truth of the robot at the last step, which is no older than any pose that was published.
    on_tick : list of callables
        Called with the simulated time [s] after each step, 60 times a second, on the simulator's thread: while one of
        them runs nothing else does and no simulated time passes.
    on_failure : list of callables
        Called once on that thread if the world or a listener raises; nothing is stepped after that.
    failure : BaseException or None
        What was raised.
    """

    def __init__(
        self,
        simulation: Simulation,
        robot: ClockedRobot,
        localization: Localization,
        server: AbstractNavigationServer,
        recorder: Recorder,
        digest: RunDigest,
    ) -> None:
        self._robot = robot
        self._simulation = simulation
        self._localization = localization
        self._server = server
        self._recorder = recorder
        self._digest = digest
        self._runtime = server.runtime
        self._scans = 0
        self._odom_stamp: float | None = None
        self._stopped = False
        self._thread: ClockThread | None = None
        self._origin = self._runtime.clock.now()
        self.true_pose = simulation.robot.pose()
        self.on_tick: list[Callable[[float], None]] = []
        self.on_failure: list[Callable[[], None]] = []
        self.failure: BaseException | None = None
        simulation.on_measurement(self._take_measurement)

    @property
    def origin(self) -> float:
        """Time [s] of the clock at which the simulation's time was 0."""
        return self._origin

    def start(self, report: Report) -> None:
        """Start the thread; ``report(time, pose, speed)`` is called ten times a second."""
        self._report = report
        self._origin = self._robot.time_offset = self._runtime.clock.now()
        self._thread = self._runtime.clock.spawn(self._loop, "simulator", Priority.SIMULATOR)

    def stop(self) -> None:
        """Step no more; in real time, wait until the present step is done, because the world may be closed next."""
        self._stopped = True
        if self._thread is not None and isinstance(self._runtime.clock, WallClock):
            self._thread.join(STOP_TIMEOUT)

    def publish(self) -> None:
        """Publish the pose that the robot's localisation gives, if it gives one; over odom where there is odometry."""
        if ODOMETRY in self._simulation.sensors:
            self._publish_over_odom(self._simulation.latest.get(ODOMETRY))
            return
        pose, robot = self._localization.measure(self._runtime.clock.now()), self._runtime.robot
        if pose is not None:
            self._runtime.transforms.set(
                Transform(pose.position, pose.orientation, robot.global_frame, robot.robot_frame, pose.stamp)
            )

    def _publish_over_odom(self, reading: WheelOdometryReading | None) -> None:
        """REP-105: odometry moves base_link in odom, and the localisation moves odom so that base_link is right."""
        if reading is None or reading.pose.stamp == self._odom_stamp:
            return
        self._odom_stamp = reading.pose.stamp
        stamp, robot = self._origin + reading.pose.stamp, self._runtime.robot
        T_odom_base = Transform.from_pose(reading.pose.stamped(stamp), robot.robot_frame)
        self._runtime.transforms.set(T_odom_base)
        believed = self._localization.measure(stamp)
        if believed is not None:
            T_map_base = Transform(
                believed.position, believed.orientation, robot.global_frame, robot.robot_frame, stamp
            )
            self._runtime.transforms.set(T_map_base @ T_odom_base.inverse())

    def _loop(self) -> None:
        """Step until the end; a thread that died without a word would leave everybody waiting for the world."""
        try:
            self._step_on()
        except BaseException as error:
            self.failure = error
            for listener in self.on_failure:
                listener()

    def _step_on(self) -> None:
        clock, tick = self._runtime.clock, 0
        while not self._stopped:
            self._simulation.advance_to(clock.now() - self._origin)
            self.true_pose = self._simulation.robot.pose()
            self._digest.pose(self.true_pose)
            self.publish()
            if tick % TICKS_PER_SAMPLE == 0:
                self._sample()
            for listener in self.on_tick:
                listener(self._simulation.time)
            tick += 1
            clock.sleep_until(self._origin + tick * PERIOD)

    def _sample(self) -> None:
        robot, time = self._simulation.robot, self._simulation.time
        pose, velocity = robot.pose(), robot.velocity()
        self._recorder.sample(time, pose, velocity, self._runtime.gate.last_command)
        self._report(time, pose, velocity.speed)

    def _take_measurement(self, name: str, measurement: Any) -> None:
        if isinstance(measurement, WheelOdometryReading):
            self._publish_over_odom(measurement)
        if not isinstance(measurement, RangeScan):
            return
        scan = replace(measurement, stamp=self._origin + measurement.stamp)
        pose, believed = self._simulation.robot.pose(), self._localization.measure(scan.stamp)
        if believed is not None and (believed.position, believed.orientation) != (pose.position, pose.orientation):
            scan = seen_from(scan, pose, believed)
        try:
            self._server.take_scan(scan)
        except Exception as error:  # a map that refuses a scan must not stop the physics
            self._runtime.events.emit(EventKind.FAULT, name, type=type(error).__name__, message=str(error))
        self._scans += 1
        if self._scans % SCANS_PER_RECORDED == 1:
            self._recorder.scan(measurement.stamp, measurement.points)
