"""The one rule for a robot that stands on forbidden ground: it may leave, never towards a higher rank.

An obstacle that appears beside a robot forbids the ground it stands on. It has to get away from there, but a rule
that only asks whether it stood on forbidden ground before lets it drive on through the obstacle. So ground has a
*rank*, see ``MeshSnapshot.traversability_rank``, interpolated within a face: from forbidden ground a step leads to
free ground, or to forbidden ground of no higher rank, and never into what is wholly lethal. Where the nearest corner
of the face is free, the ground is: planners treat it so, and their paths can be driven.

Used by every controller and recovery that looks ahead. Planners do not use it: they answer BLOCKED_START.
"""

from __future__ import annotations

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Index, plain_kernel
from mbf_mesh_nav.kernels.mesh.vectors import Vector, difference, dot, triangle

LETHAL_RANK = 4.0
"""Rank of a lethal vertex; twice that of any that is forbidden by its cost."""
_SLACK = 1e-3  # float32 costs along a ring of one cost differ by rounding


@plain_kernel
def may_enter(before: float, now: float) -> bool:
    """Whether a step may lead from ground of rank ``before`` to ``now``; 0 is free ground."""
    if now <= 0.0:
        return True
    return bool(before > 0.0 and now <= before + _SLACK and now < LETHAL_RANK - _SLACK)


@plain_kernel
def rank_at(vertices: FloatArray, faces: IntArray, ranks: Float32Array, face: int, point: Vector) -> float:
    """Rank of a point [m] in a face, between those (V,) of its corners; 0 where the nearest of them is free."""
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    if ranks[a] == 0.0 and ranks[b] == 0.0 and ranks[c] == 0.0:
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
    if ranks[nearest] == 0.0:
        return 0.0
    mixed = share_a * ranks[a] + share_b * ranks[b] + share_c * ranks[c]
    return float(max(mixed, 1e-6))
