"""A recorded mesh map: the surface once, its costs as often as they have changed.

Made from ``MeshView``, the server's own picture of its map. Costs are kept in half precision: three digits are enough
for a colour, and infinity stays infinity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.maps.view import MeshView


@dataclass(frozen=True, eq=False)
class RecordedMesh:
    """The costs of a mesh map at one time.

    Attributes
    ----------
    time : float
        [s] of the run.
    vertices : (V, 3) float64
        [m]; the same array in all records of a run.
    faces : (F, 3) int32
    costs : (V,) float16
        In the map's own unit; inf is forbidden.
    """

    time: float
    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    costs: NDArray[np.float16]


def add_if_changed(meshes: list[RecordedMesh], time: float, view: MeshView) -> None:
    """Append what a server shows of its map unless that looks as it did last."""
    costs = half_precision(view.costs)
    if not meshes:
        meshes.append(RecordedMesh(time, view.vertices.copy(), view.faces.copy(), costs))
    elif len(costs) == len(meshes[0].vertices) and not np.array_equal(costs, meshes[-1].costs):
        meshes.append(RecordedMesh(time, meshes[0].vertices, meshes[0].faces, costs))


def half_precision(costs: NDArray[np.float32]) -> NDArray[np.float16]:
    """Costs (V,) with three digits; the largest finite ones stay finite."""
    top = np.finfo(np.float16).max
    return np.where(np.isinf(costs), np.inf, np.minimum(costs, top)).astype(np.float16)


def highest_cost(meshes: list[RecordedMesh]) -> float:
    """Highest finite cost of all records, 1 where there is none: where a scale of colours ends."""
    highest = max((float(mesh.costs[np.isfinite(mesh.costs)].max(initial=0.0)) for mesh in meshes), default=0.0)
    return highest or 1.0


def mesh_arrays(meshes: list[RecordedMesh]) -> dict[str, Any]:
    """All records as arrays for a file: the surface once, times (n,), costs (n, V)."""
    if not meshes:
        return {}
    return {
        "mesh_vertices": meshes[0].vertices,
        "mesh_faces": meshes[0].faces,
        "mesh_times": np.array([mesh.time for mesh in meshes], np.float64),
        "mesh_costs": np.array([mesh.costs for mesh in meshes], np.float16),
    }


def meshes_from(arrays: dict[str, Any]) -> list[RecordedMesh]:
    """Read what ``mesh_arrays`` made; older recordings may have none."""
    if "mesh_times" not in arrays:
        return []
    vertices, faces = arrays["mesh_vertices"], arrays["mesh_faces"]
    records = zip(arrays["mesh_times"].tolist(), arrays["mesh_costs"], strict=True)
    return [RecordedMesh(time, vertices, faces, costs) for time, costs in records]
