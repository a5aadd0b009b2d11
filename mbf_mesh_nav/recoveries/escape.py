"""Leave surface that has become forbidden: drive slowly to the nearest free vertex over the surface.

For a robot that stands in an inflated or lethal area (a new obstacle, a pushed robot), where every planner answers
BLOCKED_START. It crosses costly surface on purpose, so it is slow, short (``max_distance``) and measures distance on
the surface, never across a gap or to another storey. It crosses lethal surface only where the robot stands on it,
without knowing the obstacle: order it after ``clear`` and ``back_up``. Where an obstacle appears on the escape path
while it drives, or the end of the path is no longer safe, it searches for another path and stops if there is none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_to
from mbf_abstract.geometry.tangent_plane import ground_distance
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters, GuardedRecovery
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, IntArray
from mbf_mesh_nav.kernels.search.dijkstra import follow_predecessors, propagate_distances
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.surface_point import nearest_corner
from mbf_mesh_nav.motion.goal_approach import clamp
from mbf_mesh_nav.plugins import MeshRecovery
from mbf_mesh_nav.search.leg_search import NO_OFFSETS, NO_TARGETS, search_graph, seeded_arrays, threshold_step

SURFACE_DISTANCE = 1.0
"""A robot farther [m] from the surface is not on it."""


class EscapeParameters(GuardedMotionParameters):
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


class EscapeRecovery(MeshRecovery, GuardedRecovery):
    """Drives to the nearest safe surface."""

    Parameters = EscapeParameters
    parameters: EscapeParameters

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
        path = self._escape_path(spot, own_patch, request)

        def velocity(pose: Pose) -> Twist | RecoveryResult:
            nonlocal path
            now = mesh_map.snapshot()
            if path is not None:
                path.tracker.update(pose.position)
                if not path.is_open(_lethal(now) & ~own_patch, now.blocked(p.cost_limit)):
                    here = mesh_map.locate_one(pose.position, SURFACE_DISTANCE)
                    path = None if here is None else self._escape_path(here, own_patch, request)
            if path is None:
                message = f"no safe surface within {p.max_distance:g} m along the surface"
                return RecoveryResult(RecoveryOutcome.IMPASSABLE, message)
            return self._drive(pose, path.tracker)

        return self.drive(request, velocity)

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
        lethal = _lethal(snapshot)
        if not lethal[nearest_corner(self.mesh_map, spot)]:
            return np.zeros_like(lethal)
        return np.isfinite(self._propagate(spot, ~lethal, flag)[0])

    def _escape_path(self, spot: SurfacePoint, own_patch: BoolArray, request: RecoveryRequest) -> EscapePath | None:
        """Path over the mesh to the nearest vertex around which no face is forbidden, on the current map.

        It leads over costly surface, and of lethal vertices (V,) only over those of ``own_patch``.
        """
        mesh_map, snapshot = self.mesh_map, self.mesh_map.snapshot()
        blocked = snapshot.blocked(self.parameters.cost_limit)
        distances, predecessors = self._propagate(spot, _lethal(snapshot) & ~own_patch, request.cancel_token.flag)
        beside_blocked = blocked[mesh_map.edges].any(axis=1)
        safe = ~blocked
        safe[mesh_map.edges[beside_blocked].ravel()] = False
        candidates = np.where(safe, distances, np.inf)
        nearest = int(np.argmin(candidates))
        if not candidates[nearest] <= self.parameters.max_distance:
            return None
        chain = follow_predecessors(predecessors, nearest)[::-1]
        points = np.concatenate([[spot.point], mesh_map.vertices[chain]])
        return EscapePath(chain, PathTracker(Path.from_points(points, frame_id=mesh_map.frame_id)))

    def _propagate(self, spot: SurfacePoint, closed: BoolArray, flag: FlagArray) -> tuple[Float32Array, IntArray]:
        """Lengths of the paths from the robot to all vertices but the ``closed`` ones, and their predecessors."""
        mesh_map = self.mesh_map
        distances, predecessors, seeds = seeded_arrays(mesh_map, closed, spot)
        graph = search_graph(mesh_map, mesh_map.neighbour_lengths, closed)
        step = threshold_step(mesh_map)
        propagate_distances(graph, distances, predecessors, seeds, step, NO_TARGETS, NO_OFFSETS, flag)
        return distances, predecessors


def _lethal(snapshot: MeshSnapshot) -> BoolArray:
    """Vertices (V,) that no robot may touch, whatever the cost limit."""
    return np.asarray(snapshot.lethal | np.isposinf(snapshot.costs))
