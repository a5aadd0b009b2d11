"""Leave surface that has become forbidden: drive slowly to the nearest free vertex over the surface.

For a robot that stands in an inflated or lethal area (a new obstacle, a pushed robot), where every planner answers
BLOCKED_START. It crosses costly surface on purpose, so it is slow, short (``max_distance``) and measures distance on
the surface, never across a gap or to another storey. It crosses lethal surface only where the robot stands on it,
without knowing the obstacle: order it after ``clear`` and ``back_up``. Where an obstacle appears on the escape path
while it drives, or the end of the path is no longer safe, it searches for another path and stops if there is none.
A robot that cannot turn on the spot, as a car, or must not, as on a steep slope, drives the shortest manoeuvre out
instead: forward and backward, in curves it can drive. Its centre crosses what the path might. On a slope where no such
manoeuvre leads out a robot that can turn on the spot takes the path after all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses, arc_to
from mbf_abstract.geometry.tangent_plane import ground_distance
from mbf_abstract.maps.controllers.failures import obstacle_text
from mbf_abstract.maps.manoeuvres import LEAST_RADIUS, Step, find_manoeuvre
from mbf_abstract.maps.queries import one_by_one
from mbf_abstract.maps.recoveries.manoeuvre_recovery import ManoeuvreParameters, ManoeuvreRecovery
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, IntArray
from mbf_mesh_nav.kernels.search.dijkstra import follow_predecessors, propagate_distances
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.motion_check import SURFACE_DISTANCE
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.mesh.surface_point import nearest_corner
from mbf_mesh_nav.mesh.turning import slope_at
from mbf_mesh_nav.motion.goal_approach import clamp
from mbf_mesh_nav.motion.leaving_surface import LeavingSurface
from mbf_mesh_nav.plugins import MeshRecovery
from mbf_mesh_nav.search.leg_search import NO_OFFSETS, NO_TARGETS, search_graph, seeded_arrays, threshold_step

LOOK_STEP = 0.05
"""Distance [m] of the places that a motion in curves is looked at."""


class EscapeParameters(ManoeuvreParameters):
    """Parameters of ``mesh.escape``."""

    cost_limit: float = parameter(0.9, "Surface is safe below this cost.", gt=0.0, allow_inf=True)
    max_distance: float = parameter(2.0, "Longest path over forbidden surface.", unit="m", gt=0.0, le=20.0)
    speed: float = parameter(0.2, "Driving speed.", unit="m/s", gt=0.0, le=1.0)
    yaw_rate: float = parameter(0.6, "Yaw rate limit.", unit="rad/s", gt=0.0, le=3.0)
    reach: float = parameter(0.1, "The free vertex is reached within this distance.", unit="m", gt=0.0)
    time_limit: float = parameter(40.0, "Give up after this time.", unit="s", gt=0.0, le=600.0)


@dataclass(frozen=True)
class EscapePath:
    """A path to safe surface.

    Attributes
    ----------
    vertices : (n,) int32
        Over which it leads, from the robot on.
    tracker : PathTracker
        Of the robot along the polyline from where it stood over these vertices.
    """

    vertices: IntArray
    tracker: PathTracker

    def is_open(self, lethal: BoolArray, blocked: BoolArray) -> bool:
        """Whether no vertex ahead of the robot is ``lethal`` (V,), nor the end ``blocked`` (V,)."""
        ahead = self.vertices[self.tracker.lengths[1:] > self.tracker.progress]
        return not (lethal[ahead].any() or blocked[self.vertices[-1]])


class EscapeRecovery(MeshRecovery, ManoeuvreRecovery):
    """Drives to the nearest safe surface."""

    Parameters = EscapeParameters
    parameters: EscapeParameters
    may_go_deeper = True
    _own_patch: BoolArray

    @classmethod
    def reach(cls, parameters: EscapeParameters) -> float:
        """To the end of the longest path, from a robot beside the surface."""
        return parameters.max_distance + SURFACE_DISTANCE

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Find the nearest free vertex, drive there; a free start is a success at once."""
        p, mesh_map, flag = self.parameters, self.mesh_map, request.cancel_token.flag
        spot = mesh_map.locate_one(request.motion.pose().position, SURFACE_DISTANCE)
        if spot is None:
            text = f"the robot is more than {SURFACE_DISTANCE:g} m from the surface"
            return RecoveryResult(RecoveryOutcome.FAILURE, text)
        snapshot = mesh_map.snapshot()
        if not snapshot.blocked(p.cost_limit)[mesh_map.faces[spot.face]].any():
            return RecoveryResult(RecoveryOutcome.SUCCESS, "the robot stands on a safe surface")
        own_patch = self._patch_below(spot, snapshot, flag)
        steep = slope_at(mesh_map.topology, spot) > mesh_map.max_turning_slope
        if radius := self.min_turning_radius or steep * LEAST_RADIUS:
            result = self._leave_in_curves(own_patch, radius, request)
            if self.min_turning_radius > 0.0 or result.outcome != RecoveryOutcome.IMPASSABLE:
                return result
        return self._leave_along_surface(own_patch, request)

    def _leave_along_surface(self, own_patch: BoolArray, request: RecoveryRequest) -> RecoveryResult:
        """Drive along the shortest path over the mesh, with turns on the spot where it bends."""
        p, mesh_map = self.parameters, self.mesh_map
        spot = mesh_map.locate_one(request.motion.pose().position, SURFACE_DISTANCE)
        path = None if spot is None else self._escape_path(spot, own_patch, request)

        def velocity(pose: Pose) -> Twist | RecoveryResult:
            nonlocal path
            now = mesh_map.snapshot()
            if path is not None:
                path.tracker.update(pose.position)
                if not path.is_open(now.untouchable & ~own_patch, now.blocked(p.cost_limit)):
                    here = mesh_map.locate_one(pose.position, SURFACE_DISTANCE)
                    path = None if here is None else self._escape_path(here, own_patch, request)
            if path is None:
                return self._nowhere("along the surface")
            return self._drive(pose, path.tracker)

        return self.drive(request, velocity)

    def _nowhere(self, by: str) -> RecoveryResult:
        text = f"no safe surface within {self.parameters.max_distance:g} m {by}"
        return RecoveryResult(RecoveryOutcome.IMPASSABLE, text)

    def _leave_in_curves(self, own_patch: BoolArray, radius: float, request: RecoveryRequest) -> RecoveryResult:
        """Drive the shortest manoeuvre with curves of a radius [m] at least."""
        mesh_map, token, self._own_patch = self.mesh_map, request.cancel_token, own_patch

        def search(pose: Pose) -> list[Step] | RecoveryResult:
            begin = self.on_map(pose)
            spot = mesh_map.locate_one(begin.position, SURFACE_DISTANCE)
            if spot is None:
                return self._nowhere("by a manoeuvre")
            distances, _, safe = self._reached(spot, own_patch, request)
            if safe[nearest_corner(mesh_map, spot)]:
                return RecoveryResult(RecoveryOutcome.SUCCESS, "reached a safe surface")
            surface = LeavingSurface(mesh_map, begin, np.isfinite(distances), safe & np.isfinite(distances))
            longest = self.parameters.max_distance
            questions = one_by_one(surface.may_pass, np.bool_), one_by_one(surface.left, np.float64)
            steps = find_manoeuvre(*questions, longest, radius, lambda: token.cancelled)
            return self._nowhere("by a manoeuvre") if steps is None else steps

        return self.drive_out(request, search)

    def obstacle_on_manoeuvre(self, pose: Pose, command: Twist) -> str:
        """Lethal surface that the robot's centre would come to, but for what it stood on, on the current map."""
        closed, duration, there = (
            self.mesh_map.snapshot().untouchable,
            self.parameters.check_ahead_time,
            self.on_map(pose),
        )
        surface = LeavingSurface(self.mesh_map, there, ~closed | self._own_patch, closed)
        motion = command.vx, command.vy, command.wz, duration, min(LOOK_STEP / max(command.speed, 1e-6), duration)
        ahead = map(tuple, arc_poses((0.0, 0.0, 0.0), *motion).tolist())
        hit = next((one for one in ahead if not surface.may_pass(one)), None)
        return "" if hit is None else obstacle_text(position_text(surface.on_map(hit).position))

    def obstacle_ahead(self, pose: Pose, command: Twist) -> str:
        """Always empty: it checks its path itself, which leads over forbidden surface on purpose."""
        return ""

    def _drive(self, pose: Pose, tracker: PathTracker) -> Twist | RecoveryResult:
        """Pursue the escape path; success at its end."""
        p = self.parameters
        x, y, z = tracker.points[-1].tolist()
        if ground_distance(pose, Pose((x, y, z), frame_id=pose.frame_id)) <= p.reach:
            return RecoveryResult(RecoveryOutcome.SUCCESS, f"reached a safe surface after {tracker.length:.2f} m")
        bearing, curvature = arc_to(pose, tracker.point_at(tracker.progress + 0.3))
        if abs(bearing) > 0.6:
            return Twist.planar(wz=math.copysign(p.yaw_rate, bearing))
        return Twist.planar(vx=p.speed, wz=clamp(p.speed * curvature, p.yaw_rate))

    def _patch_below(self, spot: SurfacePoint, snapshot: MeshSnapshot, flag: FlagArray) -> BoolArray:
        """Lethal vertices (V,) connected to the one the robot stands on; none if it stands beside them."""
        lethal = snapshot.untouchable
        if not lethal[nearest_corner(self.mesh_map, spot)]:
            return np.zeros_like(lethal)
        return np.isfinite(self._propagate(spot, ~lethal, flag)[0])

    def _escape_path(self, spot: SurfacePoint, own_patch: BoolArray, request: RecoveryRequest) -> EscapePath | None:
        """Path over the mesh to the nearest vertex around which no face is forbidden, on the current map.

        It leads over costly surface, and of lethal vertices (V,) only over those of ``own_patch``.
        """
        mesh_map = self.mesh_map
        distances, predecessors, safe = self._reached(spot, own_patch, request)
        candidates = np.where(safe, distances, np.inf)
        nearest = int(np.argmin(candidates))
        if not candidates[nearest] <= self.parameters.max_distance:
            return None
        chain = follow_predecessors(predecessors, nearest)[::-1]
        points = np.concatenate([[spot.point], mesh_map.vertices[chain]])
        return EscapePath(chain, PathTracker(Path.from_points(points, frame_id=mesh_map.frame_id)))

    def _reached(
        self, spot: SurfacePoint, own_patch: BoolArray, request: RecoveryRequest
    ) -> tuple[Float32Array, IntArray, BoolArray]:
        """As ``_propagate``, on the current map, and the vertices (V,) around which no face is forbidden."""
        mesh_map, snapshot = self.mesh_map, self.mesh_map.snapshot()
        blocked = snapshot.blocked(self.parameters.cost_limit)
        beside_blocked = blocked[mesh_map.edges].any(axis=1)
        safe = ~blocked
        safe[mesh_map.edges[beside_blocked].ravel()] = False
        return *self._propagate(spot, snapshot.untouchable & ~own_patch, request.cancel_token.flag), safe

    def _propagate(self, spot: SurfacePoint, closed: BoolArray, flag: FlagArray) -> tuple[Float32Array, IntArray]:
        """Lengths of the paths from the robot to all vertices but the ``closed`` ones, and their predecessors."""
        mesh_map = self.mesh_map
        distances, predecessors, seeds = seeded_arrays(mesh_map, closed, spot)
        graph = search_graph(mesh_map, mesh_map.neighbour_lengths, closed)
        step = threshold_step(mesh_map)
        propagate_distances(graph, distances, predecessors, seeds, step, NO_TARGETS, NO_OFFSETS, flag)
        return distances, predecessors
