"""Base class of the simulated sensors.

``Simulation`` calls ``measure`` at the sensor's rate. All noise comes from the sensor's own generator, so that one
sensor's faults do not shift another's noise. Three switches make it fail, for scenarios: ``silent`` (no measurement),
``stale`` (the last measurement again, with its old stamp) and ``wrong`` (new measurements with wrong values).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

import numpy as np

from terrain.physics.protocols import SimulatedRobot

Measurement = TypeVar("Measurement")


class Sensor(ABC, Generic[Measurement]):
    """Base of all sensors.

    Parameters
    ----------
    robot : SimulatedRobot
        Carries the sensor.
    rate : float
        Measurements per second of simulated time.
    rng : numpy Generator
        Draws the noise; belongs to this sensor alone.

    Attributes
    ----------
    silent, stale, wrong : bool
        Fault switches, see the module's text.
    """

    def __init__(self, robot: SimulatedRobot, rate: float, rng: np.random.Generator) -> None:
        self.robot = robot
        self.rate = rate
        self.rng = rng
        self.silent = False
        self.stale = False
        self.wrong = False
        self._last: Measurement | None = None

    def measure(self, stamp: float) -> Measurement | None:
        """Measure at ``stamp`` [s]; None where the sensor gives nothing."""
        if self.silent:
            return None
        if self.stale:
            return self._last
        measurement = self._sense(stamp)
        self._last = self._falsify(measurement) if self.wrong else measurement
        return self._last

    @abstractmethod
    def _sense(self, stamp: float) -> Measurement:
        """Take a correct measurement, with noise."""

    @abstractmethod
    def _falsify(self, measurement: Measurement) -> Measurement:
        """Return the wrong measurement of a defective sensor."""
