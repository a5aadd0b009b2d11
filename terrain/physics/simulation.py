"""One simulated world with a robot and its sensors, stepped in lockstep by the owner of the clock.

``advance_to`` is a pure function of the simulation's parts, its seeds and the commands sent: no thread, no
clock, no global state. In a run, a thread of ``SimClock`` calls it at a steady period; in a test, call it directly.

Example
-------
>>> simulation = Simulation(world, robot, {"scan": lidar})
>>> robot.send_command(Twist.planar(0.5))
>>> simulation.advance_to(0.2)
>>> simulation.latest["scan"].points
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from mbf_abstract.geometry import Pose
from mbf_abstract.time.clock import TIME_RESOLUTION
from terrain.physics.encounters import NOBODY, Surroundings
from terrain.physics.incidents import Incident, IncidentMonitor
from terrain.physics.protocols import Actor, SimulatedRobot, SimulatedWorld
from terrain.sensors.sensor import Sensor

MONITOR_RATE = 20.0  # Hz

Listener = Callable[[str, Any], None]


class Simulation:
    """World, robot and sensors on one time line.

    Parameters
    ----------
    world : SimulatedWorld
        With its clock at the instant at which the run starts, that is after ``robot.settle()``.
    sensors : mapping of str to Sensor
        By topic; each measures at its own rate, the first time at once.
    actors : sequence of Actor
        What else moves there; encounters with them are incidents.
    fellows : mapping of str to Actor
        Other robots that navigate there, by name, with a simulation each: stepping one of them steps the world for all.

    Attributes
    ----------
    latest : dict of str to measurement
        Newest measurement of each sensor that has given one.
    monitor : IncidentMonitor
        Counts what goes wrong.
    incidents : list of Incident
        All so far.
    on_incident : list of callables
        Called with each incident when it begins to count.
    track : list of Pose
        Ground truth of the robot at 20 Hz.
    """

    def __init__(
        self,
        world: SimulatedWorld,
        robot: SimulatedRobot,
        sensors: Mapping[str, Sensor[Any]] | None = None,
        actors: Sequence[Actor] = (),
        fellows: Mapping[str, Actor] = NOBODY,
    ) -> None:
        self.world = world
        self.robot = robot
        self.sensors = dict(sensors or {})
        self.monitor = IncidentMonitor()
        self.latest: dict[str, Any] = {}
        self.incidents: list[Incident] = []
        self.track: list[Pose] = []
        self.on_incident: list[Callable[[Incident], None]] = []
        self._surroundings = Surroundings(robot.spec, actors, fellows)
        self._listeners: list[Listener] = []
        self._monitor_period = self._steps_per(MONITOR_RATE)
        self._schedule = [(name, sensor, self._steps_per(sensor.rate)) for name, sensor in self.sensors.items()]
        self._steps = 0
        self._observe()
        world.after_step(self._take_step)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.world.time

    def on_measurement(self, listener: Listener) -> None:
        """Call ``listener(name, measurement)`` for every measurement from now on, in the order of the sensors."""
        self._listeners.append(listener)

    def advance_to(self, time: float) -> None:
        """Step until the world's time is at least ``time`` [s]; does nothing if it is already."""
        while self.world.time < time - TIME_RESOLUTION:
            self.world.step()

    def _take_step(self) -> None:
        self._steps += 1
        self._observe()

    def _observe(self) -> None:
        """Take the measurements that are due at this step."""
        if self._steps % self._monitor_period == 0:
            sample = self.robot.motion_sample()
            self.track.append(sample.pose)
            found = self.monitor.update(replace(sample, others=self._surroundings.look(sample.pose)))
            self.incidents += found
            for listener in self.on_incident:
                for incident in found:
                    listener(incident)
        for name, sensor, period in self._schedule:
            if self._steps % period == 0:
                measurement = sensor.measure(self.world.time)
                if measurement is not None:
                    self._deliver(name, measurement)

    def _steps_per(self, rate: float) -> int:
        return max(1, round(1.0 / (rate * self.world.time_step)))

    def _deliver(self, name: str, measurement: Any) -> None:
        self.latest[name] = measurement
        for listener in self._listeners:
            listener(name, measurement)
