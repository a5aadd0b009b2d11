"""Move away from the nearest obstacle: straight for an omnidirectional robot, else forward or back.

When to use: the robot is not in a collision but so near to an obstacle that turning or planning fails. When not:
between two obstacles at equal distance. It ends (IMPASSABLE) as soon as a cell further on the clearance would not be
larger than the largest so far.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_costmap_nav.control.guarded_motion import GuardedMotionParameters, GuardedRecovery
from mbf_costmap_nav.grid.costmap import LETHAL
from mbf_costmap_nav.grid.footprint_check import arc_poses

LEAST_GAIN = 0.2
"""Metres of clearance a metre of motion must bring; with less the robot slides along an obstacle or nears another."""


class MoveAwayParameters(GuardedMotionParameters):
    """Parameters of ``costmap.move_away``."""

    clearance: float = parameter(0.6, "Distance of the base from obstacles to reach.", unit="m", gt=0.0, le=10.0)
    speed: float = parameter(0.1, "How fast.", unit="m/s", gt=0.0, le=2.0)
    omnidirectional: bool = parameter(False, "Whether the robot can move sideways.")


class MoveAwayRecovery(GuardedRecovery):
    """Gains distance from the nearest lethal cell."""

    Parameters: ClassVar[type[PluginParameters]] = MoveAwayParameters
    parameters: MoveAwayParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Move until the clearance is reached or cannot be improved."""
        stuck, best, probe = False, 0.0, self.costmap.snapshot().resolution

        def velocity(pose: Pose) -> Twist:
            nonlocal stuck, best
            offset = self._nearest_obstacle(pose)
            best, command = max(best, math.hypot(*offset)), self._away(offset)
            duration = probe / self.parameters.speed
            at = (pose.x, pose.y, pose.yaw)
            x, y, _ = arc_poses(at, command.vx, command.vy, 0.0, duration, duration)[-1].tolist()
            there = replace(pose, position=(x, y, pose.z))
            stuck = math.hypot(*self._nearest_obstacle(there)) < best + LEAST_GAIN * probe
            return Twist() if stuck else command

        def finished(pose: Pose) -> bool:
            return stuck or math.hypot(*self._nearest_obstacle(pose)) >= self.parameters.clearance

        result = self.drive(request, velocity, finished)
        reached = math.hypot(*self._nearest_obstacle(request.motion.pose()))
        if stuck:
            return RecoveryResult(RecoveryOutcome.IMPASSABLE, f"cannot move away, the clearance is {reached:.2f} m")
        return RecoveryResult(result.outcome, f"{result.message or 'done'}, the clearance is {reached:.2f} m")

    def _nearest_obstacle(self, pose: Pose) -> tuple[float, float]:
        """Position [m] of the nearest lethal cell in the base frame; infinite if it is beyond the clearance."""
        costmap, pose = self.costmap.snapshot(), self.on_map(pose)
        reach = math.ceil(self.parameters.clearance / costmap.resolution) + 1
        ix, iy = costmap.world_to_cell_clamped(pose.x, pose.y)
        x0, y0 = max(ix - reach, 0), max(iy - reach, 0)
        rows, columns = np.nonzero(costmap.cells[y0 : iy + reach + 1, x0 : ix + reach + 1] == LETHAL)
        if rows.size == 0:
            return (math.inf, 0.0)
        offsets = costmap.cells_to_world(np.column_stack([columns + x0, rows + y0])) - (pose.x, pose.y)
        dx, dy = offsets[int(np.argmin(np.hypot(*offsets.T)))].tolist()
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        return (c * dx + s * dy, c * dy - s * dx)

    def _away(self, offset: tuple[float, float]) -> Twist:
        """Velocity away from a point in the base frame."""
        speed = self.parameters.speed
        if not self.parameters.omnidirectional:
            return Twist.planar(vx=-math.copysign(speed, offset[0]))
        distance = max(math.hypot(*offset), 1e-6)
        return Twist.planar(vx=-speed * offset[0] / distance, vy=-speed * offset[1] / distance)
