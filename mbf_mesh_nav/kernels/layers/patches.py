"""Height differences of dense meshes: connected patches of the mesh are taken into a neighbourhood as a whole.

Where a radius holds thousands of vertices, most of them are far inside it. A patch of which all lies inside brings in
all its vertices at once, and they are looked at only if its bounds reach beyond the heights already found. The values
are those of ``neighbourhood_layers.height_differences``, bit for bit: bounds decide only with ``_SLACK`` to spare.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.mesh.vectors import Vector, difference, dot, norm, row

Borders = tuple[IntArray, IntArray, IntArray]
"""Offsets (P + 1,) of the entries of each patch, the vertices next to it (b,), where the next patch's begin (b,)."""

_PATCH_SIZE = 48  # vertices; more of them make the boundary of a neighbourhood dearer, fewer its inside
_SLACK = 1e-6  # of the lengths compared; far above their rounding


@kernel
def grow_patches(vertices: FloatArray, offsets: IntArray, neighbours: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Cut a mesh into connected patches of at most ``_PATCH_SIZE`` vertices.

    Returns
    -------
    patch_of, members, begins : (V,) int32, (V,) int32, (P + 1,) int32
        The patch of each vertex, the vertices in order of patches, and where each patch begins among them.
    """
    count = vertices.shape[0]
    patch_of = np.empty(count, dtype=np.int32)
    fill(patch_of, Count(-1))
    members, begins = np.empty(count, dtype=np.int32), np.empty(count + 1, dtype=np.int32)
    patches, size = Count(0), Count(0)
    for seed in range(count):
        if patch_of[seed] >= 0:
            continue
        begin = head = size
        begins[patches], members[size], patch_of[seed] = begin, seed, patches
        size += 1
        while head < size and size - begin < _PATCH_SIZE:
            vertex = members[head]
            head += 1
            for entry in range(offsets[vertex], offsets[vertex + 1]):
                other = neighbours[entry]
                if patch_of[other] < 0 and size - begin < _PATCH_SIZE:
                    members[size], patch_of[other] = other, patches
                    size += 1
        patches += 1
    begins[patches] = count
    return patch_of, members, begins[: patches + 1].copy()


@kernel
def bound_patches(vertices: FloatArray, normals: FloatArray, members: IntArray, begins: IntArray) -> FloatArray:
    """Disc about each patch, (P, 8): middle, radius [m], axis, and half its thickness along the axis [m]."""
    bounds = np.empty((len(begins) - 1, 8), dtype=np.float64)
    for patch in range(len(begins) - 1):
        middle, axis, share = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0 / (begins[patch + 1] - begins[patch])
        for index in range(begins[patch], begins[patch + 1]):
            point, normal = row(vertices, Count(members[index])), row(normals, Count(members[index]))
            middle = middle[0] + share * point[0], middle[1] + share * point[1], middle[2] + share * point[2]
            axis = axis[0] + normal[0], axis[1] + normal[1], axis[2] + normal[2]
        length = max(norm(axis), 1e-300)
        axis = axis[0] / length, axis[1] / length, axis[2] / length
        radius = thickness = 0.0
        for index in range(begins[patch], begins[patch + 1]):
            offset = difference(row(vertices, Count(members[index])), middle)
            radius, thickness = max(radius, norm(offset)), max(thickness, abs(dot(offset, axis)))
        for k in range(3):
            bounds[patch, k], bounds[patch, 4 + k] = middle[k], axis[k]
        bounds[patch, 3], bounds[patch, 7] = radius, thickness
    return bounds


def patch_borders(patch_of: IntArray, offsets: IntArray, neighbours: IntArray, patches: int) -> Borders:
    """Vertices next to each patch, those of one neighbouring patch together."""
    sources = np.repeat(patch_of, np.diff(offsets))
    crosses = sources != patch_of[neighbours]
    outside, sources = neighbours[crosses], sources[crosses]
    order = np.lexsort((outside, patch_of[outside], sources))
    outside, sources = outside[order], sources[order]
    is_first = np.ones(len(order) + 1, dtype=np.bool_)
    is_first[1:-1] = (np.diff(sources) != 0) | (np.diff(patch_of[outside]) != 0)
    groups = np.flatnonzero(is_first)
    following = groups[np.cumsum(is_first[:-1])]
    begins = np.searchsorted(sources, np.arange(patches + 1))
    return begins.astype(np.int32), outside.astype(np.int32), following.astype(np.int32)


@inner_kernel
def _height_and_reach(bounds: FloatArray, patch: int, foot: Vector, normal: Vector) -> tuple[float, float]:
    """Height of a patch's middle along a normal, and how far its vertices can be above or below that [m]."""
    offset = difference(row(bounds, patch), foot)
    axis = bounds[patch, 4], bounds[patch, 5], bounds[patch, 6]
    along = dot(axis, normal)
    across = math.sqrt(max(dot(normal, normal) - along * along, 0.0))
    reach = abs(along) * bounds[patch, 7] + across * bounds[patch, 3]
    return dot(offset, normal), reach + _SLACK * (norm(offset) + bounds[patch, 3])


@inner_kernel
def _is_inside(bounds: FloatArray, patch: int, foot: Vector, normal: Vector, radius: float, along_limit: float) -> bool:
    """Whether all of a patch lies in the cylinder about a normal."""
    own_radius = bounds[patch, 3]
    if own_radius >= radius:
        return False
    offset = difference(row(bounds, patch), foot)
    along = dot(offset, normal)
    across = math.sqrt(max(dot(offset, offset) - along * along, 0.0))
    needed = own_radius + _SLACK * (norm(offset) + own_radius + radius)
    return bool(across + needed < radius and abs(along) + needed < along_limit)


@kernel
def height_differences_by_patches(
    vertices: FloatArray,
    normals: FloatArray,
    offsets: IntArray,
    neighbours: IntArray,
    radius: float,
    along_limit: float,
    patch_of: IntArray,
    members: IntArray,
    begins: IntArray,
    bounds: FloatArray,
    borders: Borders,
) -> Float32Array:
    """Greatest minus least height along the own normal, as ``height_differences`` gives it, (V,) [m]."""
    count = vertices.shape[0]
    differences = np.empty(count, dtype=np.float32)
    border_begins, border_vertices, border_next = borders
    seen, judged = np.empty(count, dtype=np.int32), np.empty(len(bounds), dtype=np.int32)
    fill(seen, Count(-1))
    fill(judged, Count(-1))
    is_taken = np.empty(len(bounds), dtype=np.bool_)
    single, taken = np.empty(count, dtype=np.int32), np.empty(len(bounds), dtype=np.int32)
    for vertex in range(count):
        foot, normal = row(vertices, vertex), row(normals, vertex)
        lowest = highest = 0.0
        singles, takens, single_head, taken_head = Count(0), Count(0), Count(0), Count(0)
        # The own patch is judged first; where it is not inside, the centre is the first single vertex.
        own = Count(patch_of[vertex])
        judged[own], is_taken[own] = vertex, _is_inside(bounds, own, foot, normal, radius, along_limit)
        if is_taken[own]:
            taken[0], takens = own, Count(1)
        else:
            single[0], singles, seen[vertex] = vertex, Count(1), vertex
        while single_head < singles or taken_head < takens:
            is_patch = taken_head < takens
            if is_patch:
                entry, end = border_begins[taken[taken_head]], border_begins[taken[taken_head] + 1]
                taken_head += 1
            else:
                entry, end = offsets[single[single_head]], offsets[single[single_head] + 1]
                single_head += 1
            while entry < end:
                other = Count(border_vertices[entry] if is_patch else neighbours[entry])
                patch = Count(patch_of[other])
                if judged[patch] != vertex:
                    judged[patch] = vertex
                    is_taken[patch] = _is_inside(bounds, patch, foot, normal, radius, along_limit)
                    if is_taken[patch]:
                        taken[takens] = patch
                        takens += 1
                        height = dot(normal, difference(row(vertices, Count(members[begins[patch]])), foot))
                        lowest, highest = min(lowest, height), max(highest, height)
                entry = border_next[entry] if is_patch and is_taken[patch] else entry + 1
                if is_taken[patch] or seen[other] == vertex:
                    continue
                seen[other] = vertex
                offset = difference(row(vertices, other), foot)
                along = dot(offset, normal)
                if dot(offset, offset) - along * along < radius * radius and abs(along) <= along_limit:
                    single[singles] = other
                    singles += 1
                    height = dot(normal, offset)
                    lowest, highest = min(lowest, height), max(highest, height)
        for index in range(takens):
            patch = Count(taken[index])
            height, reach = _height_and_reach(bounds, patch, foot, normal)
            if height + reach > highest or height - reach < lowest:
                for member in range(begins[patch], begins[patch + 1]):
                    height = dot(normal, difference(row(vertices, Count(members[member])), foot))
                    lowest, highest = min(lowest, height), max(highest, height)
        differences[vertex] = highest - lowest
    return differences
