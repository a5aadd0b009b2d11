"""Leave a collision: creep forward or back, whichever lowers what lies under the footprint, until it is free.

When to use: the planner answers BLOCKED_START or a controller COLLISION because the robot stands on cells that are now
lethal or inscribed. When not: the marks are ghosts; clear the costmap first. It stops (IMPASSABLE) where neither
direction is better than staying.

Rule: among forward, back and both turns, each tried over ``probe_distance``, take the one with the fewest cells under
the footprint that are lethal or off the map, and then the lowest cost at the centre; repeat until the centre
is below ``free_cost``. An unknown cell there counts as free; outside the map does not.
"""

from __future__ import annotations

from typing import ClassVar

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters, GuardedRecovery
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_costmap_nav.grid.costmap import UNKNOWN
from mbf_costmap_nav.grid.motion_check import blocked_cells, obstacle_ahead
from mbf_costmap_nav.plugins import CostmapRecovery

OFF_MAP = 256
"""Cost of a centre outside the map: more than that of any cell."""


class EscapeParameters(GuardedMotionParameters):
    """Parameters of ``costmap.escape``."""

    speed: float = parameter(0.05, "How fast to creep.", unit="m/s", gt=0.0, le=0.5)
    yaw_rate: float = parameter(0.2, "How fast to turn; 0 = only forward and back.", unit="rad/s", ge=0.0, le=2.0)
    probe_distance: float = parameter(0.15, "How far ahead each motion is judged.", unit="m", gt=0.0, le=2.0)
    free_cost: int = parameter(253, "Free once the centre's cost is below this and nothing is touched.", ge=1, le=254)


class EscapeRecovery(CostmapRecovery, GuardedRecovery):
    """Creeps out of a collision."""

    Parameters: ClassVar[type[PluginParameters]] = EscapeParameters
    parameters: EscapeParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Creep down the cost until the robot is free."""
        start = request.motion.pose()
        stuck = False

        def velocity(pose: Pose) -> Twist:
            nonlocal stuck
            best = min(self._motions(), key=lambda motion: self._badness(pose, motion))
            stuck = self._badness(pose, best) >= self._badness(pose, Twist())
            return Twist() if stuck else best

        def finished(pose: Pose) -> bool:
            touched, cost = self._badness(pose, Twist())
            return stuck or (touched == 0 and cost < self.parameters.free_cost)

        result = self.drive(request, velocity, finished)
        moved = start.distance_to(request.motion.pose())
        if stuck:
            touched, cost = self._badness(request.motion.pose(), Twist())
            state = f"{touched} cells under the footprint are obstacles or off the map"
            centre = "lies off the map" if cost == OFF_MAP else f"costs {cost}"
            text = f"no motion leads out of the collision, moved {moved:.2f} m: {state}, the centre {centre}"
            return RecoveryResult(RecoveryOutcome.IMPASSABLE, text)
        return RecoveryResult(result.outcome, f"{result.message or 'free'}, moved {moved:.2f} m")

    def obstacle_ahead(self, pose: Pose, command: Twist) -> str:
        """As for all recoveries, but the motion may begin in a collision of any depth: it was chosen to lead out."""
        costmap, duration = self.costmap.snapshot(), self.parameters.check_ahead_time
        there = self.on_map(pose)
        return obstacle_ahead(costmap, self.costmap.footprint, there, command, duration, leaves_collisions=True)

    def _motions(self) -> list[Twist]:
        p = self.parameters
        motions = [Twist.planar(vx=-p.speed), Twist.planar(vx=p.speed)]
        if p.yaw_rate > 0.0:
            motions += [Twist.planar(wz=p.yaw_rate), Twist.planar(wz=-p.yaw_rate)]
        return motions

    def _badness(self, pose: Pose, motion: Twist) -> tuple[int, int]:
        """Cells in collision and cost of the centre after the probe distance; staying is judged where it is."""
        costmap, pose = self.costmap.snapshot(), self.on_map(pose)
        duration = self.parameters.probe_distance / self.parameters.speed if motion != Twist() else 1e-3
        x, y, yaw = arc_poses((pose.x, pose.y, pose.yaw), motion.vx, 0.0, motion.wz, duration, duration)[-1].tolist()
        touched, _ = blocked_cells(costmap, self.costmap.footprint, x, y, yaw)
        cost = costmap.cost_at(x, y)
        if cost == UNKNOWN:
            return touched, self.parameters.free_cost - 1
        return touched, OFF_MAP if cost is None else cost
