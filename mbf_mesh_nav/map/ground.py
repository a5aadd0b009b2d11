"""Heights of all surfaces at a place in the plan view, and which of them a robot may stand on."""

from __future__ import annotations

from collections.abc import Sequence

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.queries import CellState
from mbf_mesh_nav.map.mesh_map import MeshMap

ONE_SURFACE = 0.01
"""Surfaces so near [m] above each other are one: seams of a scan, the two sides of a thin patch."""
LEAST_UPWARD = 0.05
"""z of the normal below which a face is a wall or a ceiling."""


def ground_heights(mesh_map: MeshMap, x: float, y: float) -> tuple[float, ...]:
    """Heights [m] of the surfaces above and below (x, y); empty over a hole and past the border.

    Those the robot may stand on come first, then blocked surfaces, then ceilings; each from the lowest to the highest.
    """
    top, bottom = float(mesh_map.vertices[:, 2].max()), float(mesh_map.vertices[:, 2].min())
    check_point = mesh_map.point_check()
    ranked: list[tuple[bool, bool, float]] = []
    start = top + 1.0
    while start > bottom:
        faces, distances = mesh_map.locator.cast_rays([[x, y, start]], [[0.0, 0.0, -1.0]])
        if faces[0] < 0:
            break
        height = start - float(distances[0])
        is_ceiling = bool(mesh_map.face_normals[faces[0], 2] < LEAST_UPWARD)
        is_blocked = check_point(Pose((x, y, height))).state >= CellState.LETHAL
        ranked.append((is_ceiling, is_blocked, height))
        start = height - ONE_SURFACE
    return tuple(height for _, _, height in sorted(ranked))


def heights_text(heights: Sequence[float]) -> str:
    """The heights [m] of the surfaces at a place that is on none of them, as a text."""
    if not heights:
        return "there is no surface above or below it"
    return f"the surface there is at z = {', '.join(f'{height:.2f}' for height in sorted(heights))} m"
