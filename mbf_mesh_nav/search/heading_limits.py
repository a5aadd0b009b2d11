"""Headings that the tilt allows: at a point, straight within a face, along an edge.

Two sources: the footprint of a ``tilt`` layer, settled anywhere, or normals of the surface where a map has no such
layer. Both give a *use*, the greatest share of a limit: at most 1 is allowed.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray
from mbf_mesh_nav.kernels.layers.chassis import Chassis, Scratch, scratch_for
from mbf_mesh_nav.kernels.layers.footprint_sweep import greatest_use
from mbf_mesh_nav.kernels.mesh.slopes import slopes_of_edges, tilt_of_normals
from mbf_mesh_nav.kernels.search.heading_astar import DRIVABLE, FORBIDDEN, HEADING_STEP, HEADINGS
from mbf_mesh_nav.layers.tilt import TiltLayer
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.search.drive_graph import DriveGraph

NO_CHASSIS = Chassis(1.0, 1.0, False, 1.0, 1.0, 1.0, math.inf)


def chassis_of(layer: TiltLayer) -> Chassis:
    """Measures and limits of a tilt layer, as they are now."""
    settings = layer.parameters
    roll, up, down = (math.tan(limit) for limit in layer.limits())
    return Chassis(settings.wheelbase, settings.track, settings.rigid, roll, up, down, layer.room_below)


class HeadingLimits(Protocol):
    """Limits as a planner with headings queries them.

    Attributes
    ----------
    allowed, roll : (V, 16) bool, (V, 16) float32 [rad]
        Where the robot may stand with which heading, and how it rolls there.
    known : (m,) uint8
        What is known of each move of a drive graph, see ``kernels.search.heading_astar``.
    chassis : Chassis
        For moves of which nothing is known.
    scratch : Scratch
        Memory for sweeps on this map, of one thread at a time.
    knows_footprint : bool
        Whether the limits hold on lines over several faces, too.
    """

    allowed: BoolArray
    roll: Float32Array
    known: NDArray[np.uint8]
    chassis: Chassis
    scratch: Scratch
    knows_footprint: bool

    def standing(self, place: SurfacePoint, yaw: float) -> float:
        """Use at a point with a heading [rad]."""

    def driving(self, face: int, start: FloatArray, end: FloatArray, ends: list[FloatArray]) -> float:
        """Greatest use (1 = at the limit) on the line between two points (3,) [m]; ``ends`` are their normals."""


class FootprintLimits:
    """Limits of a tilt layer, as they were when this was made."""

    knows_footprint = True

    def __init__(self, mesh_map: MeshMap, layer: TiltLayer, graph: DriveGraph) -> None:
        self.allowed, self.roll = layer.allowed, layer.roll
        self.known = np.zeros(len(graph.moves.ends), dtype=np.uint8)
        self.chassis = chassis_of(layer)
        self._surface = mesh_map.topology.surface
        self.scratch = scratch_for(len(mesh_map.vertices))

    def standing(self, place: SurfacePoint, yaw: float) -> float:
        """See ``HeadingLimits``."""
        return self._use(place.face, place.point, place.point, math.cos(yaw), math.sin(yaw))

    def driving(self, face: int, start: FloatArray, end: FloatArray, ends: list[FloatArray]) -> float:
        """See ``HeadingLimits``; the normals do not matter."""
        x, y = (end - start).tolist()[:2]
        length = math.sqrt(x * x + y * y)
        return self._use(face, start, end, x / length, y / length) if length > 0.0 else math.inf

    def _use(self, face: int, start: FloatArray, end: FloatArray, cosine: float, sine: float) -> float:
        points = tuple(start.tolist()), tuple(end.tolist())
        return float(greatest_use(self._surface, self.chassis, self.scratch, int(face), *points, cosine, sine))


class NormalLimits:
    """Limits [rad] of roll and pitch on the surface's tangent planes; strides are not driven."""

    chassis = NO_CHASSIS
    knows_footprint = False

    def __init__(self, mesh_map: MeshMap, max_roll: float, max_pitch: float, graph: DriveGraph) -> None:
        self._mesh_map = mesh_map
        self.angles = max_roll, max_pitch
        self.scratch = scratch_for(len(mesh_map.vertices))
        headings = np.asarray(np.arange(HEADINGS) * HEADING_STEP, dtype=np.float64)
        self.allowed, self.roll = tilt_of_normals(mesh_map.vertex_normals, headings, max_roll, max_pitch)
        edges = mesh_map.vertices, mesh_map.neighbour_offsets, mesh_map.neighbours
        along = slopes_of_edges(*edges, mesh_map.vertex_normals, max_roll, max_pitch)
        self.known = np.full(len(graph.moves.ends), FORBIDDEN, dtype=np.uint8)
        self.known[graph.is_edge] = np.where(along, np.uint8(DRIVABLE), np.uint8(FORBIDDEN))

    def standing(self, place: SurfacePoint, yaw: float) -> float:
        """See ``HeadingLimits``."""
        return self._use(self._mesh_map.face_normals[place.face], math.cos(yaw), math.sin(yaw))

    def driving(self, face: int, start: FloatArray, end: FloatArray, ends: list[FloatArray]) -> float:
        """See ``HeadingLimits``; in between the normal goes from one end's to the other's in proportion."""
        x, y = (end - start).tolist()[:2]
        return max(self._use(normal, x, y) for normal in ends)

    def _use(self, normal: FloatArray, ahead_x: float, ahead_y: float) -> float:
        x, y, up = normal.tolist()
        up *= math.sqrt(ahead_x * ahead_x + ahead_y * ahead_y)
        roll, pitch = math.atan2(y * ahead_x - x * ahead_y, up), math.atan2(x * ahead_x + y * ahead_y, up)
        return max(abs(roll) / self.angles[0], abs(pitch) / self.angles[1])
