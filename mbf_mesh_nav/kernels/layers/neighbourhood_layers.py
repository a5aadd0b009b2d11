"""Vertex values over the connected neighbourhood of a radius: height difference, roughness, ridge.

The connected neighbourhood N_r(v) holds the vertices reached from v over mesh edges without leaving the distance r
of v; a vertex on the storey above is near but not connected, hence not in it. v itself is not counted as a member.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.mesh.vectors import Vector, difference, dot, norm, row

_SPHERE = (0.0, 0.0, 0.0)
"""Instead of a normal: distances count in all directions."""


@inner_kernel
def collect_neighbourhood(
    vertices: FloatArray,
    offsets: IntArray,
    neighbours: IntArray,
    centre: int,
    radius: float,
    normal: Vector,
    along_limit: float,
    seen: IntArray,
    members: IntArray,
) -> int:
    """Write N_r(centre) into ``members`` and return its size; ``seen`` (V,) holds the last centre that saw a vertex.

    The distance is measured across ``normal`` (a cylinder, half as high as ``along_limit``); a zero normal and an
    infinite limit make it a sphere.
    """
    seen[centre] = centre
    middle = row(vertices, centre)
    size = 0
    head = -1
    while head < size:
        vertex = centre if head < 0 else members[head]
        head += 1
        for entry in range(offsets[vertex], offsets[vertex + 1]):
            other = neighbours[entry]
            if seen[other] == centre:
                continue
            seen[other] = centre
            offset = difference(row(vertices, Count(other)), middle)
            along = dot(offset, normal)
            squared = dot(offset, offset) - along * along
            if squared < radius * radius and abs(along) <= along_limit:
                members[size] = other
                size += 1
    return size


@kernel
def height_differences(
    vertices: FloatArray,
    normals: FloatArray,
    offsets: IntArray,
    neighbours: IntArray,
    radius: float,
    along_limit: float,
) -> Float32Array:
    """Greatest minus least height along the own normal over v and N_r(v), metric across the normal, (V,) [m]."""
    count = vertices.shape[0]
    differences = np.empty(count, dtype=np.float32)
    seen = np.empty(count, dtype=np.int32)
    fill(seen, Count(-1))
    members = np.empty(count, dtype=np.int32)
    for vertex in range(count):
        foot, normal = row(vertices, vertex), row(normals, vertex)
        size = collect_neighbourhood(vertices, offsets, neighbours, vertex, radius, normal, along_limit, seen, members)
        lowest = highest = 0.0
        for index in range(size):
            height = dot(normal, difference(row(vertices, Count(members[index])), foot))
            lowest, highest = min(lowest, height), max(highest, height)
        differences[vertex] = highest - lowest
    return differences


@kernel
def mean_edge_angles(normals: FloatArray, offsets: IntArray, neighbours: IntArray) -> FloatArray:
    """Mean angle [rad] between the normal of each vertex and those of its neighbours, (V,); 0 without neighbours."""
    angles = np.empty(offsets.shape[0] - 1, dtype=np.float64)
    for vertex in range(offsets.shape[0] - 1):
        total, normal = 0.0, row(normals, vertex)
        for entry in range(offsets[vertex], offsets[vertex + 1]):
            other = Count(neighbours[entry])
            cosine = dot(normal, row(normals, other))
            total += math.acos(min(max(cosine, -1.0), 1.0))
        degree = offsets[vertex + 1] - offsets[vertex]
        angles[vertex] = total / degree if degree > 0 else 0.0
    return angles


@kernel
def neighbourhood_means(
    values: FloatArray, vertices: FloatArray, offsets: IntArray, neighbours: IntArray, radius: float
) -> Float32Array:
    """Mean of ``values`` over v and N_r(v), metric of the sphere, (V,)."""
    count = vertices.shape[0]
    means = np.empty(count, dtype=np.float32)
    seen = np.empty(count, dtype=np.int32)
    fill(seen, Count(-1))
    members = np.empty(count, dtype=np.int32)
    for vertex in range(count):
        size = collect_neighbourhood(vertices, offsets, neighbours, vertex, radius, _SPHERE, np.inf, seen, members)
        total = values[vertex]
        for index in range(size):
            total += values[members[index]]
        means[vertex] = total / (size + 1)
    return means


@kernel
def normal_tip_distances(
    vertices: FloatArray,
    normals: FloatArray,
    offsets: IntArray,
    neighbours: IntArray,
    radius: float,
    without_neighbours: float,
) -> Float32Array:
    """Mean distance [m] of the tips of unit normals planted on v and on the members of N_r(v), (V,)."""
    count = vertices.shape[0]
    distances = np.empty(count, dtype=np.float32)
    seen = np.empty(count, dtype=np.int32)
    fill(seen, Count(-1))
    members = np.empty(count, dtype=np.int32)
    for vertex in range(count):
        size = collect_neighbourhood(vertices, offsets, neighbours, vertex, radius, _SPHERE, np.inf, seen, members)
        total, tip = 0.0, _tip(vertices, normals, vertex)
        for index in range(size):
            total += norm(difference(_tip(vertices, normals, Count(members[index])), tip))
        distances[vertex] = total / size if size > 0 else without_neighbours
    return distances


@inner_kernel
def _tip(vertices: FloatArray, normals: FloatArray, vertex: int) -> Vector:
    """Where the unit normal planted on a vertex ends."""
    foot, normal = row(vertices, vertex), row(normals, vertex)
    return foot[0] + normal[0], foot[1] + normal[1], foot[2] + normal[2]
