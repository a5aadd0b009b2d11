"""The thread that steps a simulation on a clock and publishes the poses and scans of its robots."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, NamedTuple

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Command, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.clock import ClockThread, Priority, WallClock
from terrain.physics.simulation import Simulation
from terrain.recording.run_digest import RunDigest
from terrain.scenarios.faults import ODOMETRY, seen_from
from terrain.sensors.proprioception import Localization, WheelOdometryReading

STOP_TIMEOUT = 2.0  # s


class LoopRates(NamedTuple):
    """Time between two publications of the pose [s], and how many of them go on one sample of the robot."""

    period: float = 1.0 / 60.0
    ticks_per_sample: int = 6


DEFAULT_RATES = LoopRates()


class ClockedRobot:
    """The simulated robot as the server sees it: its odometry is stamped with the server's clock.

    Parameters
    ----------
    simulation : Simulation
        Its odometry is that of the wheels where the robot has that sensor, else the truth.
    send : callable
        Takes the commands for the motors.
    digest : RunDigest
        Takes every command.
    """

    def __init__(self, simulation: Simulation, send: Callable[[Command], None], digest: RunDigest) -> None:
        self.min_turning_radius = simulation.robot.spec.min_turning_radius
        self._simulation = simulation
        self._send = send
        self._digest = digest
        self.time_offset = 0.0

    def send_command(self, command: Command) -> None:
        """Hand the command to the simulated motors."""
        self._digest.command(command)
        self._send(command)

    def odometry(self) -> Odometry:
        """Measured velocity; the stamp is the clock's time, not the simulation's."""
        reading = self._simulation.latest.get(ODOMETRY)
        measured = self._simulation.robot.odometry() if reading is None else reading.odometry
        return Odometry(measured.velocity, measured.stamp + self.time_offset)


class DriveLoop:
    """Steps the simulator up to the clock's time at a fixed period; publishes pose and scans.

    Parameters
    ----------
    localization : Localization
        Its pose is what the server gets.
    server : AbstractNavigationServer
        Gets the scans; its clock drives the loop.
    digest : RunDigest
        Takes the true pose after every step.

    Attributes
    ----------
    true_pose : Pose
        Ground truth of the robot at the last step, which is no older than any pose that was published.
    on_tick : list of callables
        Called with the simulated time [s] after each period, on the simulator's thread: no simulated time passes
        while one of them runs.
    on_sample : list of callables
        Called with the simulated time [s], the true pose and the true velocity at each sample.
    on_scan : list of callables
        Called with each scan, stamped with the simulation's time.
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
        digest: RunDigest,
        rates: LoopRates = DEFAULT_RATES,
    ) -> None:
        self._robot = robot
        self._simulation = simulation
        self._localization = localization
        self._server = server
        self._digest = digest
        self._rates = rates
        self._runtime = server.runtime
        self._odom_stamp: float | None = None
        self._stopped = False
        self._thread: ClockThread | None = None
        self._origin = self._runtime.clock.now()
        self.true_pose = simulation.robot.pose()
        self.on_tick: list[Callable[[float], None]] = []
        self.on_sample: list[Callable[[float, Pose, Twist], None]] = []
        self.on_scan: list[Callable[[RangeScan], None]] = []
        self.on_failure: list[Callable[[], None]] = []
        self.failure: BaseException | None = None
        self._led: list[DriveLoop] = [self]
        simulation.on_measurement(self._take_measurement)

    @property
    def origin(self) -> float:
        """Time [s] of the clock at which the simulation's time was 0."""
        return self._origin

    def lead(self, others: Iterable[DriveLoop]) -> None:
        """Serve other robots of the same world, too: after each step, in this order; theirs are not started."""
        self._led += others

    def start(self) -> None:
        """Start the thread."""
        for loop in self._led:
            loop._origin = loop._robot.time_offset = self._runtime.clock.now()
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
        estimated = self._localization.measure(stamp)
        if estimated is not None:
            T_map_base = Transform(
                estimated.position, estimated.orientation, robot.global_frame, robot.robot_frame, stamp
            )
            self._runtime.transforms.set(T_map_base @ T_odom_base.inverse())

    def _loop(self) -> None:
        """Step until the end; report an error, because all other threads wait for this one."""
        try:
            self._step_on()
        except BaseException as error:
            for loop in self._led:
                loop.failure = error
                for listener in loop.on_failure:
                    listener()

    def _step_on(self) -> None:
        clock, tick = self._runtime.clock, 0
        while not self._stopped:
            self._simulation.advance_to(clock.now() - self._origin)
            for loop in self._led:
                loop._after_step(tick)
            tick += 1
            clock.sleep_until(self._origin + tick * self._rates.period)

    def _after_step(self, tick: int) -> None:
        self.true_pose = self._simulation.robot.pose()
        self._digest.pose(self.true_pose)
        self.publish()
        if tick % self._rates.ticks_per_sample == 0:
            self._sample()
        for listener in self.on_tick:
            listener(self._simulation.time)

    def _sample(self) -> None:
        robot = self._simulation.robot
        pose, velocity = robot.pose(), robot.velocity()
        for listener in self.on_sample:
            listener(self._simulation.time, pose, velocity)

    def _take_measurement(self, name: str, measurement: Any) -> None:
        if isinstance(measurement, WheelOdometryReading):
            self._publish_over_odom(measurement)
        if not isinstance(measurement, RangeScan):
            return
        scan = replace(measurement, stamp=self._origin + measurement.stamp)
        pose, estimated = self._simulation.robot.pose(), self._localization.measure(scan.stamp)
        if estimated is not None and (estimated.position, estimated.orientation) != (pose.position, pose.orientation):
            scan = seen_from(scan, pose, estimated)
        try:
            self._server.take_scan(scan)
        except Exception as error:  # a map that refuses a scan must not stop the physics
            self._runtime.events.emit(EventKind.FAULT, name, type=type(error).__name__, message=str(error))
        for listener in self.on_scan:
            listener(measurement)
