"""A four-wheeled footprint put down on the surface at every vertex and heading: roll, pitch and room under the belly.

The heights under the wheels are found by walking over the faces, seen from above, from one wheel position to the
next; the walk cannot leave the storey. The body takes the plane of least squares through its four wheels, which for a
rectangle has the slope of the mean heights of its sides. A rigid body on uneven ground stands on three wheels: two of
one axle or side and one of the other, so its slope is that of one side alone, and it may rock onto the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.mesh.surface import Surface

MAX_STEPS = 1000
LEAST_UPWARD = 0.05
"""z of the normal below which a face is a wall that carries no wheel."""


@inner_kernel
def face_below(surface: Surface, face: int, x: float, y: float) -> int:
    """Face whose outline seen from above holds (x, y), reached from ``face``; -1 beyond a border or at a wall."""
    for _ in range(MAX_STEPS):
        if face < 0 or surface.face_normals[face, 2] < LEAST_UPWARD:
            return -1
        following, vertices = face, surface.vertices
        for corner in range(3):
            a, b = surface.faces[face, corner], surface.faces[face, (corner + 1) % 3]
            across = (vertices[b, 0] - vertices[a, 0]) * (y - vertices[a, 1])
            across -= (vertices[b, 1] - vertices[a, 1]) * (x - vertices[a, 0])
            if across < 0.0:
                following = surface.face_neighbours[face, corner]
                break
        if following == face:
            return face
        face = following
    return -1


@inner_kernel
def wheel_heights(
    surface: Surface, start_face: int, centre: FloatArray, angles: FloatArray, radius: float, heights: FloatArray
) -> None:
    """Write the surface's z [m] at ``radius`` around ``centre`` in the ascending directions ``angles``; NaN = none."""
    face, vertices, normals = start_face, surface.vertices, surface.face_normals
    for index in range(angles.shape[0]):
        x = centre[0] + radius * np.cos(angles[index])
        y = centre[1] + radius * np.sin(angles[index])
        found = face_below(surface, face, x, y)
        if found < 0 and face != start_face:
            found = face_below(surface, start_face, x, y)
        if found < 0:
            heights[index] = np.nan
            face = start_face
            continue
        face = found
        a = surface.faces[face, 0]
        slope = normals[face, 0] * (x - vertices[a, 0]) + normals[face, 1] * (y - vertices[a, 1])
        heights[index] = vertices[a, 2] - slope / normals[face, 2]


@inner_kernel
def upward_face(surface: Surface, vertex: int) -> int:
    """Face around a vertex that looks up most, -1 if it has none that carries a wheel."""
    best, best_z = -1, LEAST_UPWARD
    for position in range(surface.vertex_face_offsets[vertex], surface.vertex_face_offsets[vertex + 1]):
        face = surface.vertex_faces[position]
        if surface.face_normals[face, 2] >= best_z:
            best, best_z = face, surface.face_normals[face, 2]
    return best


def wheel_directions(heading_count: int, wheelbase: float, track: float) -> tuple[FloatArray, NDArray[np.int64]]:
    """Directions of the wheels seen from the middle, for headings ``h * 2 pi / heading_count``.

    Returns
    -------
    angles : (4 heading_count,) float64
        Ascending [rad]; all wheels stand on one circle.
    order : (4 heading_count,) int64
        Which wheel that is: 4 h plus 0 front left, 1 rear left, 2 rear right, 3 front right.
    """
    spread = np.arctan2(track, wheelbase)
    yaws = 2.0 * np.pi * np.arange(heading_count) / heading_count
    wheels = (yaws[:, None] + [spread, np.pi - spread, np.pi + spread, -spread]).ravel() % (2.0 * np.pi)
    order = np.argsort(wheels, kind="stable")
    return wheels[order], order


@inner_kernel
def vertices_below_the_belly(surface: Surface, centre: int, radius: float, seen: IntArray, members: IntArray) -> int:
    """Write the vertices the belly could touch into ``members`` and return their number.

    They lie within ``radius`` of the centre, seen from above, and are connected there by vertices at most so much
    higher or lower. The top of a post is one of them, however high; the storey it may carry is not. ``seen`` (V,) holds
    the last centre that saw a vertex.
    """
    vertices, offsets = surface.vertices, surface.neighbour_offsets
    seen[centre] = centre
    size: int = Count(0)
    reader = Count(-1)
    while reader < size:
        vertex = Count(centre) if reader < 0 else Count(members[reader])
        reader += 1
        if abs(vertices[vertex, 2] - vertices[centre, 2]) > radius:
            continue
        for entry in range(offsets[vertex], offsets[vertex + 1]):
            other = Count(surface.neighbours[entry])
            if seen[other] == centre:
                continue
            seen[other] = centre
            dx, dy = vertices[other, 0] - vertices[centre, 0], vertices[other, 1] - vertices[centre, 1]
            if dx * dx + dy * dy < radius * radius:
                members[size] = other
                size += 1
    return size


@inner_kernel
def steeper(one: float, other: float) -> float:
    """Whichever of two slopes is farther from level."""
    return one if abs(one) >= abs(other) else other


@kernel
def settle_footprints(
    surface: Surface,
    wheel_angles: FloatArray,
    wheel_order: NDArray[np.int64],
    wheelbase: float,
    track: float,
    rigid: bool,
    margins: FloatArray,
) -> tuple[Float32Array, Float32Array, Float32Array, Float32Array]:
    """Settle a robot at every vertex and heading.

    Parameters
    ----------
    wheel_angles, wheel_order : (4 heading_count,)
        Where the wheels of all headings stand, see ``wheel_directions``.
    rigid : bool
        Whether the body stands on three wheels; then roll and pitch are the steeper of the two stances.
    margins : (V,) float64
        How much higher [m] than on the map each vertex may be below the belly.

    Returns
    -------
    roll, pitch : (V, heading_count) float32
        Left side up and nose up are positive [rad]; inf where a wheel has no ground.
    bump : (V, heading_count) float32
        How far [m] the surface inside the footprint rises above the plane of the wheels; inf likewise.
    raised : (V, heading_count) float32
        The same with each vertex higher by its margin.
    """
    vertices, count = surface.vertices, surface.vertices.shape[0]
    heading_count = len(wheel_order) // 4
    roll = np.empty((count, heading_count), dtype=np.float32)
    pitch = np.empty((count, heading_count), dtype=np.float32)
    bump = np.empty((count, heading_count), dtype=np.float32)
    raised = np.empty((count, heading_count), dtype=np.float32)
    radius = 0.5 * np.hypot(wheelbase, track)
    ring = np.empty(4 * heading_count, dtype=np.float64)
    wheels = np.empty(4 * heading_count, dtype=np.float64)
    seen = np.empty(count, dtype=np.int32)
    fill(seen, Count(-1))
    members = np.empty(count, dtype=np.int32)
    for vertex in range(count):
        for heading in range(heading_count):
            roll[vertex, heading] = pitch[vertex, heading] = np.inf
            bump[vertex, heading] = raised[vertex, heading] = np.inf
        start_face = upward_face(surface, vertex)
        if start_face < 0:
            continue
        centre = vertices[vertex]
        wheel_heights(surface, start_face, centre, wheel_angles, radius, ring)
        for index in range(len(wheel_order)):
            wheels[wheel_order[index]] = ring[index]
        size = vertices_below_the_belly(surface, vertex, radius, seen, members)
        for heading in range(heading_count):
            front_left, rear_left = wheels[4 * heading], wheels[4 * heading + 1]
            rear_right, front_right = wheels[4 * heading + 2], wheels[4 * heading + 3]
            rise_forward = 0.5 * (front_left + front_right - rear_left - rear_right) / wheelbase
            rise_left = 0.5 * (front_left + rear_left - front_right - rear_right) / track
            middle = 0.25 * (front_left + front_right + rear_left + rear_right)
            if np.isnan(middle):
                continue
            pitch[vertex, heading] = np.arctan(rise_forward)
            roll[vertex, heading] = np.arctan(rise_left)
            if rigid:
                left_side, right_side = front_left - rear_left, front_right - rear_right
                pitch[vertex, heading] = np.arctan(steeper(left_side, right_side) / wheelbase)
                front, rear = front_left - front_right, rear_left - rear_right
                roll[vertex, heading] = np.arctan(steeper(front, rear) / track)
            # The greatest height of the surface above the wheels' plane, at the vertices inside the footprint.
            yaw = 2.0 * np.pi * heading / heading_count
            cosine, sine = np.cos(yaw), np.sin(yaw)
            highest = centre[2] - middle
            highest_raised = highest + margins[vertex]
            for index in range(size):
                other = members[index]
                dx, dy = vertices[other, 0] - centre[0], vertices[other, 1] - centre[1]
                forward, left = cosine * dx + sine * dy, cosine * dy - sine * dx
                if abs(forward) <= 0.5 * wheelbase and abs(left) <= 0.5 * track:
                    plane = middle + rise_forward * forward + rise_left * left
                    height = vertices[other, 2] - plane
                    highest = max(highest, height)
                    highest_raised = max(highest_raised, height + margins[other])
            bump[vertex, heading] = highest
            raised[vertex, heading] = highest_raised
    return roll, pitch, bump, raised
