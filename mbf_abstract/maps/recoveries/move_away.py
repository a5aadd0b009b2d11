"""Move away from the nearest obstacle: straight for an omnidirectional robot, else forward or back.

When to use: the robot is so near to an obstacle that driving or planning fails. When not: between two obstacles at
equal distance. Where forward or back leads along the obstacle or into it, a robot that can turn on the spot turns until
the obstacle is behind or ahead of it, whichever is less, and tries once more. It ends (IMPASSABLE) as soon as ``PROBE``
further on the clearance would not be larger than the largest so far.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose, Twist, normalize_angle
from mbf_abstract.geometry.arithmetic import norm, rotated_back
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters, GuardedRecovery
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult

PROBE = 0.05
"""Distance ahead [m] at which the clearance is checked before a move."""
LEAST_GAIN = 0.2
"""Metres of clearance a metre of motion must bring; with less the robot slides along an obstacle."""
ASIDE = 0.5
"""Farther off the robot's axis than this [rad] an obstacle is aside."""
TURNED = 0.05
"""A turn ends when this little [rad] is left of it."""


class MoveAwayParameters(GuardedMotionParameters):
    """Parameters of ``move_away``."""

    clearance: float = parameter(0.6, "Distance of the base from obstacles to reach.", unit="m", gt=0.0, le=10.0)
    speed: float = parameter(0.1, "How fast.", unit="m/s", gt=0.0, le=2.0)
    omnidirectional: bool = parameter(False, "Whether the robot can move sideways.")
    yaw_rate: float = parameter(0.5, "How fast it turns on the spot; 0 = it does not.", unit="rad/s", ge=0.0, le=3.0)


class MoveAwayRecovery(GuardedRecovery):
    """Gains distance from the nearest obstacle."""

    Parameters: ClassVar[type[PluginParameters]] = MoveAwayParameters
    parameters: MoveAwayParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Move until the clearance is reached or cannot be improved; where it cannot at once, turn first."""
        result = self._move(request)
        if result.outcome == RecoveryOutcome.IMPASSABLE and self._can_turn:
            turn = self._turn_wanted(request.motion.pose())
            heading = normalize_angle(request.motion.pose().yaw + turn)
            if abs(turn) > ASIDE and self.turn_to_heading(request, heading, self.parameters.yaw_rate, TURNED).success:
                result = self._move(request)
        reached = float(norm(self._nearest_obstacle(request.motion.pose())))
        clearance = f"{reached:.2f} m" if math.isfinite(reached) else f"more than {self.parameters.clearance:.2f} m"
        return RecoveryResult(result.outcome, f"{result.message or 'done'}, the clearance is {clearance}")

    def _move(self, request: RecoveryRequest) -> RecoveryResult:
        best = 0.0

        def velocity(pose: Pose) -> Twist | RecoveryResult:
            nonlocal best
            offset = self._nearest_obstacle(pose)
            best = max(best, float(norm(offset)))
            command = self._away(offset)
            step = PROBE / command.speed
            ahead = pose.rotation[:, 0] * (command.vx * step) + pose.rotation[:, 1] * (command.vy * step)
            x, y, z = (np.asarray(pose.position) + ahead).tolist()
            if norm(self._nearest_obstacle(replace(pose, position=(x, y, z)))) < best + LEAST_GAIN * PROBE:
                return RecoveryResult(RecoveryOutcome.IMPASSABLE, "cannot move away")
            return command

        def finished(pose: Pose) -> bool:
            return bool(norm(self._nearest_obstacle(pose)) >= self.parameters.clearance)

        return self.drive(request, velocity, finished)

    @property
    def _can_turn(self) -> bool:
        p = self.parameters
        return p.yaw_rate > 0.0 and not p.omnidirectional and self.min_turning_radius == 0.0

    def _turn_wanted(self, pose: Pose) -> float:
        """Least turn [rad] after which the nearest obstacle is ahead or behind."""
        x, y, _ = self._nearest_obstacle(pose).tolist()
        bearing = math.atan2(y, x)
        return bearing if abs(bearing) <= 0.5 * math.pi else normalize_angle(bearing + math.pi)

    def _nearest_obstacle(self, pose: Pose) -> NDArray[np.float64]:
        """Position (3,) [m] of the nearest obstacle in the base frame; infinite if it is beyond the clearance."""
        pose = self.on_map(pose)
        offset = self.navigation_map.nearest_obstacle(pose, self.parameters.clearance)
        return np.array([math.inf, 0.0, 0.0]) if offset is None else rotated_back(pose.rotation, np.array(offset))

    def _away(self, offset: NDArray[np.float64]) -> Twist:
        """Velocity away from a point in the base frame."""
        speed, (x, y, _) = self.parameters.speed, offset.tolist()
        if not self.parameters.omnidirectional:
            return Twist.planar(vx=-math.copysign(speed, x))
        distance = max(math.hypot(x, y), 1e-6)
        return Twist.planar(vx=-speed * x / distance, vy=-speed * y / distance)
