"""Figures of a built map: what the command prints, the report shows and the map file keeps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.building.clouds.point_cloud import PointCloud
from mbf_mesh_nav.building.decimation import DecimatedMesh
from mbf_mesh_nav.building.height_errors import root_mean_square
from mbf_mesh_nav.building.surface import POINTS_PER_CELL, BuiltSurface

SPARSE = 0.01
"""More than this share of the points too far apart for a surface is worth a word."""


@dataclass(frozen=True)
class MapFacts:
    """Figures of a built map; lengths in metres, areas in square metres of the plan view.

    Attributes
    ----------
    points, outliers, sparse_points, surface_points : int
        Read; thrown away as isolated; so few, with none around, that there is no surface; on the surface.
    unit : float
        Length of the files' unit.
    origin : tuple of float
        Where the map's (0, 0, 0) lies in the coordinates of the files.
    crs : str
        Coordinate system of the files; "" = unknown.
    size : tuple of float
        Extents of the points along x, y and z.
    cell : float
        Distance between the vertices.
    density : float
        Points of a square metre of surface, the median of all cells.
    area, stacked_area : float
        Of the surface; of the places with another surface above.
    filled_area, obstacle_area, small_area : float
        Of filled holes; of what something stands on; of separate surfaces that were left out.
    error_rms, error_95, error_max : float
        Of the surface against its points, the noise of the points included; 95 % are closer than ``error_95``.
    height_error : float
        Root mean square of the standard errors of the vertices, see ``building.height_errors``, with what decimation
        adds.
    faces_before : int
        Before decimation.
    decimation_max : float
        Greatest distance that was measured between the decimated surface and the whole one; 0 = nothing was left out.
    """

    points: int
    outliers: int
    sparse_points: int
    surface_points: int
    unit: float
    origin: tuple[float, float, float]
    crs: str
    size: tuple[float, float, float]
    cell: float
    density: float
    vertices: int
    faces: int
    area: float
    stacked_area: float
    filled_area: float
    obstacle_area: float
    small_area: float
    error_rms: float
    error_95: float
    error_max: float
    height_error: float
    faces_before: int
    decimation_max: float = 0.0

    def of_decimated(self, mesh: DecimatedMesh, errors: FloatArray) -> MapFacts:
        """Facts of the map with a decimated mesh, whose vertices have these standard errors (V,) [m]."""
        return replace(
            self,
            vertices=len(mesh.vertices),
            faces=len(mesh.faces),
            height_error=root_mean_square(errors),
            decimation_max=mesh.error_max,
        )


def map_facts(cloud: PointCloud, surface: BuiltSurface) -> MapFacts:
    """Compute the figures of a surface built from a cloud."""
    patches, used = surface.patches, surface.is_used
    square = patches.grid.cell * patches.grid.cell
    distances = np.abs(surface.distances[np.isfinite(surface.distances)].astype(np.float64))
    on_surface = used & ~patches.is_filled
    of_patch = patches.ends - patches.firsts
    counts, is_bare = of_patch[on_surface], ~(used | surface.is_obstacle | surface.is_small)
    rms = float(np.sqrt((distances * distances).mean())) if len(distances) else 0.0
    points_of_cell = float(np.median(counts)) if len(counts) else 0.0
    _, levels = np.unique(patches.cells[used], return_counts=True)
    x, y, z = np.ptp(cloud.points, axis=0).tolist()
    return MapFacts(
        points=len(cloud.points),
        outliers=int(surface.is_outlier.sum()),
        sparse_points=int(of_patch[is_bare & (of_patch < POINTS_PER_CELL)].sum()),
        surface_points=len(distances),
        unit=cloud.unit,
        origin=cloud.origin,
        crs=cloud.crs,
        size=(x, y, z),
        cell=patches.grid.cell,
        density=points_of_cell / square,
        vertices=len(surface.vertices),
        faces=len(surface.faces),
        area=square * int(used.sum()),
        stacked_area=square * int((levels - 1).sum()),
        filled_area=square * int((patches.is_filled & used).sum()),
        obstacle_area=square * int(surface.is_obstacle.sum()),
        small_area=square * int(surface.is_small.sum()),
        error_rms=rms,
        error_95=float(np.percentile(distances, 95.0)) if len(distances) else 0.0,
        error_max=float(distances.max(initial=0.0)),
        height_error=root_mean_square(surface.height_errors),
        faces_before=len(surface.faces),
    )


def lines_of(facts: MapFacts) -> list[tuple[str, str]]:
    """Name and text of each line that describes a map."""
    x, y, z = facts.size
    origin = ", ".join(f"{value:.10g}" for value in facts.origin)
    unit = "taken as metres" if facts.unit == 1.0 else f"a unit of {facts.unit:g} m"
    mesh = f"{facts.vertices} vertices, {facts.faces} faces"
    if facts.faces < facts.faces_before:
        mesh += f" of {facts.faces_before}, {facts.decimation_max:.3f} m from the whole surface at most"
    thrown = f"{facts.outliers} isolated points, {facts.small_area:.0f} m² of small surfaces"
    if facts.sparse_points > SPARSE * facts.points:
        thrown += f", {facts.sparse_points} points too far apart for a surface, which a larger --cell joins"
    return [
        ("points", f"{facts.points}, {x:.1f} x {y:.1f} x {z:.1f} m, {unit}"),
        ("density", f"{facts.density:.0f} points/m², a vertex every {facts.cell:g} m"),
        ("surface", f"{facts.area:.0f} m², of which {facts.stacked_area:.0f} m² are above others"),
        ("mesh", mesh),
        ("holes", f"{facts.filled_area:.1f} m² filled"),
        ("obstacles", f"{facts.obstacle_area:.1f} m²"),
        ("left out", thrown),
        ("error", f"{facts.error_rms:.4f} m rms of the points, 95 % below {facts.error_95:.4f} m"),
        (
            "heights",
            f"{facts.height_error:.4f} m standard error among neighbours, by which layers narrow their limits",
        ),
        ("origin", f"({origin}) of the files is (0, 0, 0) of the map"),
        ("coordinates", facts.crs or "the files state no coordinate system"),
    ]
