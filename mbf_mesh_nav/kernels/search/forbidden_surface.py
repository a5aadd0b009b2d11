"""The one rule for a robot that stands on forbidden ground: it may leave, never towards what is harder.

An obstacle that appears beside a robot forbids the ground it stands on. It has to get away from there, but a rule
that only asks whether it stood on forbidden ground before lets it drive on through the obstacle. So ground has a
*hardness*, see ``MeshSnapshot.hardness``, interpolated within a face: from forbidden ground a step leads to free
ground, or to forbidden ground no harder, and never into what is wholly lethal. Where the nearest corner of the face is
free, the ground is: so do planners see it, and a path of theirs can be driven.

Used by every controller and recovery that looks ahead. Planners do not use it: they answer BLOCKED_START.
"""

from __future__ import annotations

from mbf_mesh_nav.kernels.compiled import Index, kernel
from mbf_mesh_nav.kernels.mesh.vectors import Float64Array, Vector, difference, dot, triangle
from mbf_mesh_nav.kernels.search.dijkstra import Float32Array, Int32Array

LETHAL_HARDNESS = 4.0
"""Hardness of a lethal vertex; twice that of any that is forbidden by its cost."""
_SLACK = 1e-3  # float32 costs along a ring of one cost differ by rounding


@kernel
def may_enter(before: float, now: float) -> bool:
    """Whether a step may lead from ground of hardness ``before`` to ``now``; 0 is free ground."""
    if now <= 0.0:
        return True
    return bool(before > 0.0 and now <= before + _SLACK and now < LETHAL_HARDNESS - _SLACK)


@kernel
def hardness_at(vertices: Float64Array, faces: Int32Array, hardness: Float32Array, face: int, point: Vector) -> float:
    """Hardness of a point [m] in a face, between those (V,) of its corners; 0 where the nearest of them is free."""
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    if hardness[a] == 0.0 and hardness[b] == 0.0 and hardness[c] == 0.0:
        return 0.0
    # Barycentric coordinates by dot products (Ericson, Real-Time Collision Detection, section 3.4).
    corner_a, corner_b, corner_c = triangle(vertices, faces, Index(face))
    along_b, along_c, offset = (
        difference(corner_b, corner_a),
        difference(corner_c, corner_a),
        difference(point, corner_a),
    )
    aa, ab, bb = dot(along_b, along_b), dot(along_b, along_c), dot(along_c, along_c)
    ap, bp = dot(offset, along_b), dot(offset, along_c)
    area = aa * bb - ab * ab
    share_b = (bb * ap - ab * bp) / area if area > 0.0 else 0.0
    share_c = (aa * bp - ab * ap) / area if area > 0.0 else 0.0
    share_a = 1.0 - share_b - share_c
    nearest = a if share_a >= max(share_b, share_c) else (b if share_b >= share_c else c)
    if hardness[nearest] == 0.0:
        return 0.0
    mixed = share_a * hardness[a] + share_b * hardness[b] + share_c * hardness[c]
    return float(max(mixed, 1e-6))
