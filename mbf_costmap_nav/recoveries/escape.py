"""Leave what a robot must not stand in: creep off what it touches, then drive out of areas and inflated cells.

When to use: the planner answers BLOCKED_START or a controller COLLISION because the robot stands on cells that are now
lethal or inscribed: something has come near, or it was pushed or started in a keep-out area. When not: the marks are
ghosts; clear the costmap first. It stops (IMPASSABLE) where nothing leads out.

First what stands there, on the map without drawn areas: among forward, back and both turns (the tightest curves of a
robot with a turning circle), each tried over ``probe_distance``, the robot takes the one with the fewest cells under
the footprint that are lethal or off the map, and then the lowest cost at the centre, until it touches nothing. Then
what is only forbidden, on all maps of the server: it drives the shortest manoeuvre, at most ``max_distance`` long, that
touches nothing more and ends where the outline is free and the centre below ``free_cost``. An unknown cell there counts
as free; outside the map does not.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.manoeuvres import Step, find_manoeuvre, radius_beyond
from mbf_abstract.maps.pull_out import ROOM
from mbf_abstract.maps.queries import PlanarPose, one_by_one
from mbf_abstract.maps.recoveries.manoeuvre_recovery import ManoeuvreParameters, ManoeuvreRecovery
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.control.leaving import Leaving
from mbf_costmap_nav.grid.costmap import UNKNOWN
from mbf_costmap_nav.grid.motion_check import blocked_cells, obstacle_ahead
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.plugins import CostmapRecovery

OFF_MAP = 256
"""Cost of a centre outside the map: more than that of any cell."""


class EscapeParameters(ManoeuvreParameters):
    """Parameters of ``costmap.escape``."""

    speed: float = parameter(0.05, "How fast to creep off what it touches.", unit="m/s", gt=0.0, le=0.5)
    yaw_rate: float = parameter(0.2, "How fast to turn; 0 = only forward and back.", unit="rad/s", ge=0.0, le=2.0)
    probe_distance: float = parameter(0.15, "How far ahead each motion is judged.", unit="m", gt=0.0, le=2.0)
    free_cost: int = parameter(253, "Free once the centre's cost is below this and nothing is touched.", ge=1, le=254)
    area_speed: float = parameter(0.2, "How fast to drive out of what is only forbidden.", unit="m/s", gt=0.0, le=1.0)
    max_distance: float = parameter(2.0, "Longest manoeuvre out of it.", unit="m", gt=0.0, le=20.0)
    time_limit: float = parameter(40.0, "Give up a straight, a curve or a turn after this time.", unit="s", gt=0.0)


class EscapeRecovery(CostmapRecovery, ManoeuvreRecovery):
    """Creeps out of a collision, and drives out of forbidden ground."""

    Parameters: ClassVar[type[PluginParameters]] = EscapeParameters
    parameters: EscapeParameters
    may_go_deeper = True

    @property
    def manoeuvre_speed(self) -> float:
        """``area_speed``: nothing is touched on the way."""
        return self.parameters.area_speed

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Creep until nothing is touched, then drive until the robot is free on all maps."""
        start = request.motion.pose()
        result = self._creep(request)
        if result.success:
            result = self._leave(request)
        moved = f"moved {start.distance_to(request.motion.pose()):.2f} m"
        return RecoveryResult(result.outcome, f"{result.message or 'free'}, {moved}")

    # ---------------------------------------------------------------------------------------- what it touches
    def _creep(self, request: RecoveryRequest) -> RecoveryResult:
        """Take the best motion until nothing is touched, or until none is better than staying."""
        stuck = False

        def velocity(pose: Pose) -> Twist:
            nonlocal stuck
            best = min(self._motions(), key=lambda motion: self._badness(pose, motion))
            stuck = self._badness(pose, best) >= self._badness(pose, Twist())
            return Twist() if stuck else best

        def finished(pose: Pose) -> bool:
            return stuck or self._badness(pose, Twist())[0] == 0

        result = self.drive(request, velocity, finished, self._obstacle_creeping)
        touched, cost = self._badness(request.motion.pose(), Twist())
        if not stuck or touched == 0:
            return result
        state = f"{touched} cells under the footprint are obstacles or off the map"
        centre = "lies off the map" if cost == OFF_MAP else f"costs {cost}"
        text = f"no motion leads out of the collision: {state}, the centre {centre}"
        return RecoveryResult(RecoveryOutcome.IMPASSABLE, text)

    def _obstacle_creeping(self, pose: Pose, command: Twist) -> str:
        """The motion may begin in a collision of any depth: it was chosen to lead out."""
        return self._obstacle_on(self.costmap, pose, command, leaves_collisions=True)

    def _motions(self) -> list[Twist]:
        p = self.parameters
        motions = [Twist.planar(vx=-p.speed), Twist.planar(vx=p.speed)]
        if p.yaw_rate > 0.0 and self.min_turning_radius > 0.0:
            wz = min(p.yaw_rate, p.speed / self.min_turning_radius)
            motions += [Twist.planar(vx=motion.vx, wz=turn) for motion in motions for turn in (wz, -wz)]
        elif p.yaw_rate > 0.0:
            motions += [Twist.planar(wz=p.yaw_rate), Twist.planar(wz=-p.yaw_rate)]
        return motions

    def _badness(self, pose: Pose, motion: Twist) -> tuple[int, int]:
        """Cells in collision and cost of the centre after the probe distance; staying is judged where it is."""
        pose, p = self.on_map(pose), self.parameters
        reach = p.probe_distance + self.costmap.footprint.circumscribed_radius
        costmap = self.costmap.without_areas(pose.x, pose.y, reach + 1.0)
        duration = p.probe_distance / p.speed if motion != Twist() else 1e-3
        x, y, yaw = arc_poses((pose.x, pose.y, pose.yaw), motion.vx, 0.0, motion.wz, duration, duration)[-1].tolist()
        touched, _ = blocked_cells(costmap, self.costmap.footprint, x, y, yaw)
        cost = costmap.cost_at(x, y)
        if cost == UNKNOWN:
            return touched, p.free_cost - 1
        return touched, OFF_MAP if cost is None else cost

    # ------------------------------------------------------------------------------------- what is forbidden
    def _leave(self, request: RecoveryRequest) -> RecoveryResult:
        """Drive the shortest manoeuvre to where all maps are free."""

        def search(begin: Pose) -> list[Step] | RecoveryResult:
            maps = self._leaving(begin)
            if all(one.is_free for one in maps):
                return RecoveryResult(RecoveryOutcome.SUCCESS)
            steps = self._manoeuvre(maps, request.cancel_token)
            if steps is not None:
                return steps
            closed = "; ".join(one.reason for one in maps if not one.is_free)
            text = f"no manoeuvre of {self.parameters.max_distance:g} m leads to where the robot may stand: {closed}"
            return RecoveryResult(RecoveryOutcome.IMPASSABLE, text)

        return self.drive_out(request, search)

    def _manoeuvre(self, maps: list[Leaving], token: CancelToken) -> list[Step] | None:
        """Shortest manoeuvre with room around the outline, or without where there is none."""
        p = self.parameters
        turning_radius = self.min_turning_radius if p.yaw_rate > 0.0 else radius_beyond(p.max_distance)

        def left(pose: PlanarPose) -> float:
            return max(one.left(pose) for one in maps)

        for room in (ROOM, 0.0):

            def may_pass(pose: PlanarPose, room: float = room) -> bool:
                return all(one.may_pass(pose, room) for one in maps)

            questions = one_by_one(may_pass, np.bool_), one_by_one(left, np.float64)
            steps = find_manoeuvre(*questions, p.max_distance, turning_radius, lambda: token.cancelled)
            if steps is not None:
                return steps
        return None

    def _leaving(self, pose: Pose) -> list[Leaving]:
        """Leaving what is forbidden, on each map, from a pose."""
        p = self.parameters
        return [Leaving(one, self.on_map(pose, one), p.max_distance, p.free_cost) for one in self._costmaps()]

    def _costmaps(self) -> list[LayeredCostmap]:
        """All maps of the server, its own first; each once."""
        return list(dict.fromkeys((self.costmap, self.local_costmap, self.global_costmap)))

    def obstacle_ahead(self, pose: Pose, command: Twist) -> str:
        """As for all recoveries, but drawn areas are no obstacle, and all maps count."""
        return next(filter(None, (self._obstacle_on(one, pose, command) for one in self._costmaps())), "")

    def obstacle_on_manoeuvre(self, pose: Pose, command: Twist) -> str:
        """As ``obstacle_ahead``."""
        return self.obstacle_ahead(pose, command)

    def _obstacle_on(
        self, costmap: LayeredCostmap, pose: Pose, command: Twist, *, leaves_collisions: bool = False
    ) -> str:
        there, duration = self.on_map(pose, costmap), self.parameters.check_ahead_time
        reach = command.speed * duration + costmap.footprint.circumscribed_radius + 1.0
        standing = costmap.without_areas(there.x, there.y, reach)
        over_end = costmap.rolling_window
        return obstacle_ahead(
            standing,
            costmap.footprint,
            there,
            command,
            duration,
            leaves_collisions=leaves_collisions,
            may_overhang=over_end and not leaves_collisions,
        )
