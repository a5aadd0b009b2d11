"""What goes wrong with sensors and localisation in a scenario, from one time to another."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import rotated, rotated_back
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.physics.actors import AnyWorld
from terrain.scenarios.places import FULL_TURN, Offset
from terrain.sensors.proprioception import Localization
from terrain.sensors.sensor import Sensor

LOCALIZATION, ODOMETRY, IMU = "localization", "odometry", "imu"
"""Names of the proprioceptive sensors and of the localisation, for faults."""


class TimedFault(ParameterModel):
    """A fault that holds from ``start`` until just before ``end``."""

    start: float = parameter(..., "When it begins.", unit="s", ge=0.0)
    end: float = parameter(math.inf, "When it ends; absent = never.", unit="s", gt=0.0, allow_inf=True)

    def holds_at(self, time: float) -> bool:
        """Whether it holds at ``time`` [s]."""
        return self.start <= time < self.end


class SensorFault(TimedFault):
    """A sensor gives nothing, repeats its last measurement, or gives wrong values."""

    type: Literal["silent", "stale", "wrong"]
    sensor: str = parameter(..., "Name of the sensor, or localization, odometry or imu.")


class LocalizationJump(TimedFault):
    """The localisation is off by a fixed amount; scans end up in the wrong place with it."""

    type: Literal["jump"]
    dx: Offset = parameter(0.0, "Error along x.", unit="m")
    dy: Offset = parameter(0.0, "Error along y.", unit="m")
    dyaw: float = parameter(0.0, "Error of the heading.", unit="rad", ge=-FULL_TURN, le=FULL_TURN)


Fault = Annotated[SensorFault | LocalizationJump, Field(discriminator="type")]


class FaultSchedule:
    """Switches the faults of a scenario on and off as the world's time passes."""

    def __init__(
        self,
        world: AnyWorld,
        sensors: Mapping[str, Sensor[Any]],
        localization: Localization,
        faults: Sequence[SensorFault | LocalizationJump],
    ) -> None:
        self._world = world
        self._localization = localization
        self._sensors = {**sensors, LOCALIZATION: localization}
        self._sensor_faults: list[SensorFault] = []
        self._jumps: list[LocalizationJump] = []
        for fault in faults:
            self.add(fault)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names that a sensor fault can have."""
        return tuple(self._sensors)

    def add(self, fault: SensorFault | LocalizationJump) -> None:
        """Let one more fault happen; raises ValueError for a sensor that does not exist."""
        if isinstance(fault, SensorFault) and fault.sensor not in self._sensors:
            raise ValueError(f"expected one of {', '.join(self._sensors)}, got {fault.sensor!r}")
        if not (self._sensor_faults or self._jumps):
            self._world.before_step(self._apply)
        if isinstance(fault, SensorFault):
            self._sensor_faults.append(fault)
        else:
            self._jumps.append(fault)

    def _apply(self) -> None:
        now = self._world.time
        for fault in self._sensor_faults:
            sensor = self._sensors[fault.sensor]
            same = [other for other in self._sensor_faults if (other.sensor, other.type) == (fault.sensor, fault.type)]
            setattr(sensor, fault.type, any(other.holds_at(now) for other in same))
        holding = [jump for jump in self._jumps if jump.holds_at(now)]
        dx, dy, dyaw = (sum(getattr(jump, name) for jump in holding) for name in ("dx", "dy", "dyaw"))
        self._localization.offset = (dx, dy, dyaw)


def seen_from(scan: RangeScan, true_pose: Pose, estimated_pose: Pose) -> RangeScan:
    """Return a scan as it appears in the map of a robot whose localisation gives ``estimated_pose``."""

    def estimated(points: NDArray[np.float64]) -> NDArray[np.float64]:
        in_base = rotated_back(true_pose.rotation, points - true_pose.position)
        return rotated(estimated_pose.rotation, in_base) + estimated_pose.position

    return replace(scan, origin=estimated(scan.origin), ends=estimated(scan.ends))
