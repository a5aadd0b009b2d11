"""A four-wheeled chassis on a surface: the plane of its wheels, and the ground that rises below its belly."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.mesh.vectors import Vector


class Chassis(NamedTuple):
    """Measures [m] of a robot and its limits: greatest slopes (tangents) across, up and down, height of the belly [m].

    A rigid body stands on three wheels, see ``footprint_settling``; then the slopes of single sides and axles count.
    """

    wheelbase: float
    track: float
    rigid: bool
    roll: float
    pitch_up: float
    pitch_down: float
    clearance: float


class Scratch(NamedTuple):
    """Memory of one search after the other: vertices' marks and members (V,), last mark (1,), wheels, their faces.

    Each search makes a mark of its own, so nothing is cleared between two; marks repeat after 2^32 searches.
    """

    seen: IntArray
    members: IntArray
    mark: IntArray
    wheels: FloatArray
    wheel_faces: IntArray


def scratch_for(vertex_count: int) -> Scratch:
    """Fresh memory."""
    seen, members = np.full(vertex_count, -1, dtype=np.int32), np.empty(vertex_count, dtype=np.int32)
    mark, wheel_faces = np.zeros(1, dtype=np.int32), np.empty(4, dtype=np.int32)
    return Scratch(seen, members, mark, np.empty((4, 2), dtype=np.float64), wheel_faces)


@inner_kernel
def wheel_plane(
    surface: Surface, chassis: Chassis, scratch: Scratch, moment: float, x: float, y: float
) -> tuple[float, float, float, float]:
    """Height of the middle of the wheels, slopes forward and to the left, and the greatest share of a slope's limit."""
    front_left = _height_below(surface, scratch, Count(0), moment, x, y)
    rear_left = _height_below(surface, scratch, Count(1), moment, x, y)
    rear_right = _height_below(surface, scratch, Count(2), moment, x, y)
    front_right = _height_below(surface, scratch, Count(3), moment, x, y)
    left, right = (front_left - rear_left) / chassis.wheelbase, (front_right - rear_right) / chassis.wheelbase
    front, rear = (front_left - front_right) / chassis.track, (rear_left - rear_right) / chassis.track
    forward, leftward = 0.5 * (left + right), 0.5 * (front + rear)
    if not chassis.rigid:
        left, right, front, rear = forward, forward, leftward, leftward
    up, down, across = max(left, right), max(-left, -right), max(abs(front), abs(rear))
    use = max(across / chassis.roll, up / chassis.pitch_up, down / chassis.pitch_down)
    return 0.25 * (front_left + rear_left + rear_right + front_right), forward, leftward, use


@inner_kernel
def _height_below(surface: Surface, scratch: Scratch, wheel: int, moment: float, x: float, y: float) -> float:
    """Height [m] below a wheel at a share of the drive, on the plane of its face."""
    face = scratch.wheel_faces[wheel]
    a = surface.faces[face, 0]
    right = scratch.wheels[wheel, 0] + moment * x - surface.vertices[a, 0]
    ahead = scratch.wheels[wheel, 1] + moment * y - surface.vertices[a, 1]
    slope = surface.face_normals[face, 0] * right + surface.face_normals[face, 1] * ahead
    return float(surface.vertices[a, 2] - slope / surface.face_normals[face, 2])


@inner_kernel
def gather_below(surface: Surface, chassis: Chassis, scratch: Scratch, face: int, start: Vector, end: Vector) -> int:
    """Write the vertices the belly could touch into ``members`` and return their number.

    As in ``footprint_settling``, with the line of the drive instead of one vertex: within a radius of it, and
    connected there, beginning at the corners of the face, by vertices at most so much higher or lower.
    """
    radius = 0.5 * math.sqrt(chassis.wheelbase * chassis.wheelbase + chassis.track * chassis.track)
    scratch.mark[0] += 1
    mark, size, reader = scratch.mark[0], Count(0), Count(0)
    for corner in range(3):
        vertex = Count(surface.faces[face, corner])
        scratch.seen[vertex] = mark
        scratch.members[size] = vertex
        size += 1
    x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    squared = x * x + y * y
    while reader < size:
        vertex = Count(scratch.members[reader])
        reader += 1
        share = _share_beside(surface.vertices, vertex, start, x, y, squared)
        if abs(surface.vertices[vertex, 2] - start[2] - share * z) > radius:
            continue
        for entry in range(surface.neighbour_offsets[vertex], surface.neighbour_offsets[vertex + 1]):
            other = Count(surface.neighbours[entry])
            if scratch.seen[other] == mark:
                continue
            scratch.seen[other] = mark
            share = _share_beside(surface.vertices, other, start, x, y, squared)
            dx = surface.vertices[other, 0] - start[0] - share * x
            dy = surface.vertices[other, 1] - start[1] - share * y
            if dx * dx + dy * dy < radius * radius:
                scratch.members[size] = other
                size += 1
    return size  # type: ignore[no-any-return]


@inner_kernel
def _share_beside(vertices: FloatArray, vertex: int, start: Vector, x: float, y: float, squared: float) -> float:
    """Where on the line, as a share of it, a vertex is nearest, seen from above."""
    if squared == 0.0:
        return 0.0
    along = (vertices[vertex, 0] - start[0]) * x + (vertices[vertex, 1] - start[1]) * y
    return float(min(max(along / squared, 0.0), 1.0))


@inner_kernel
def highest_below(
    surface: Surface,
    chassis: Chassis,
    scratch: Scratch,
    size: int,
    start: Vector,
    x: float,
    y: float,
    cosine: float,
    sine: float,
    now: float,
    until: float,
) -> float:
    """How far [m] a vertex below the belly rises above the plane of the wheels, at most, between two moments."""
    highest, length = -math.inf, cosine * x + sine * y
    for index in range(size):
        vertex = scratch.members[index]
        dx, dy = surface.vertices[vertex, 0] - start[0], surface.vertices[vertex, 1] - start[1]
        forward, left = cosine * dx + sine * dy, cosine * dy - sine * dx
        if abs(left) > 0.5 * chassis.track:
            continue
        # It is below the body from the moment the front passes it until the rear has.
        begin, end = now, until
        if length > 0.0:
            begin, end = (
                max(begin, (forward - 0.5 * chassis.wheelbase) / length),
                min(end, (forward + 0.5 * chassis.wheelbase) / length),
            )
        elif abs(forward) > 0.5 * chassis.wheelbase:
            continue
        if begin > end:
            continue
        z, half = surface.vertices[vertex, 2], 0.5 * (begin + end)
        first, middle, last = (
            z - _plane_at(surface, chassis, scratch, begin, x, y, forward - begin * length, left),
            z - _plane_at(surface, chassis, scratch, half, x, y, forward - half * length, left),
            z - _plane_at(surface, chassis, scratch, end, x, y, forward - end * length, left),
        )
        highest = max(highest, first, last)
        # The parabola through the three, over shares of the interval: its top may lie between them.
        bend = 2.0 * (first + last - 2.0 * middle)
        rise = last - first - bend
        if bend < 0.0 and 0.0 < rise < -2.0 * bend:
            highest = max(highest, first - 0.25 * rise * rise / bend)
    return float(highest)


@inner_kernel
def _plane_at(
    surface: Surface, chassis: Chassis, scratch: Scratch, moment: float, x: float, y: float, forward: float, left: float
) -> float:
    """Height [m] of the plane of the wheels at a place of the body."""
    middle, rise_forward, rise_left, _ = wheel_plane(surface, chassis, scratch, moment, x, y)
    return float(middle + rise_forward * forward + rise_left * left)
