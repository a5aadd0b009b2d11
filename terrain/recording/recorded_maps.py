"""Recorded maps: the costs of a grid, or of a mesh whose surface is kept once, at several times of a run.

Made from ``GridView`` and ``MeshView``, which a server gives of its map. The costs of a grid are kept in steps of a
hundredth, one byte each, so that the maps of a run of some minutes need a few hundred kilobytes; those of a mesh in
half precision, because three digits are enough for a colour and infinity stays infinity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.maps.view import GridView, MeshView

FORBIDDEN = 100
UNKNOWN = 255


@dataclass(frozen=True, eq=False)
class RecordedGrid:
    """The costs of a grid map at one time.

    Attributes
    ----------
    time : float
        [s] of the run.
    cells : (height, width) uint8
        0 free to 100 forbidden, 255 unknown; row 0 at the smallest y.
    extent : (x_min, x_max, y_min, y_max)
        [m]
    """

    time: float
    cells: NDArray[np.uint8]
    extent: tuple[float, float, float, float]

    @classmethod
    def of(cls, time: float, view: GridView) -> RecordedGrid:
        """Keep what a server shows of its map."""
        levels = np.round(FORBIDDEN * np.clip(view.costs, 0.0, 1.0))
        return cls(time, np.where(np.isnan(levels), UNKNOWN, levels).astype(np.uint8), view.extent)

    @property
    def costs(self) -> NDArray[np.float32]:
        """(height, width) 0 free to 1 forbidden, nan unknown."""
        levels = self.cells.astype(np.float32) / np.float32(FORBIDDEN)
        return np.where(self.cells == UNKNOWN, np.float32(np.nan), levels)


def grid_arrays(grids: list[RecordedGrid], name: str = "grid") -> dict[str, Any]:
    """All grids as four arrays for a file: flat cells, shapes (n, 2), extents (n, 4), times (n,)."""
    return {
        f"{name}_cells": np.concatenate([np.zeros(0, np.uint8), *(grid.cells.ravel() for grid in grids)]),
        f"{name}_shapes": np.array([grid.cells.shape for grid in grids], np.int64).reshape(-1, 2),
        f"{name}_extents": np.array([grid.extent for grid in grids], np.float64).reshape(-1, 4),
        f"{name}_times": np.array([grid.time for grid in grids], np.float64),
    }


def grids_from(arrays: dict[str, Any], name: str = "grid") -> list[RecordedGrid]:
    """Read what ``grid_arrays`` made; older recordings may have none."""
    if f"{name}_cells" not in arrays:
        return []
    cells, shapes, extents, times = (arrays[f"{name}_{part}"] for part in ("cells", "shapes", "extents", "times"))
    ends = np.cumsum(shapes.prod(axis=1))
    parts = np.split(cells, ends[:-1]) if len(ends) else []
    facts = zip(times.tolist(), parts, shapes, extents.tolist(), strict=True)
    return [RecordedGrid(time, part.reshape(shape), tuple(extent)) for time, part, shape, extent in facts]


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


class RecordedLayer(NamedTuple):
    """The costs of one layer of a mesh map, on the surface of the first ``RecordedMesh``.

    Attributes
    ----------
    costs : (V,) float16
        inf is forbidden.
    unit : str
        Of the costs; empty = none, as in recordings of earlier versions.
    """

    name: str
    costs: NDArray[np.float16]
    unit: str = ""


def layer_arrays(layers: list[RecordedLayer]) -> dict[str, Any]:
    """All layers as arrays for a file: names and units (n,), costs (n, V)."""
    if not layers:
        return {}
    return {
        "layer_names": np.array([layer.name for layer in layers]),
        "layer_units": np.array([layer.unit for layer in layers]),
        "layer_costs": np.array([one.costs for one in layers]),
    }


def layers_from(arrays: dict[str, Any]) -> list[RecordedLayer]:
    """Read what ``layer_arrays`` made; older recordings may have none."""
    if "layer_names" not in arrays:
        return []
    names = arrays["layer_names"].tolist()
    units = arrays["layer_units"].tolist() if "layer_units" in arrays else [""] * len(names)
    return [RecordedLayer(*one) for one in zip(names, arrays["layer_costs"], units, strict=True)]


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
