"""From points to the faces a robot may drive on: ground, bridges and storeys, without what stands on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from pydantic import ValidationInfo, field_validator

from mbf_abstract.geometry.arithmetic import tan
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.building.clouds.point_cloud import CLEARANCE
from mbf_mesh_nav.building.decks import on_decks
from mbf_mesh_nav.building.height_errors import height_errors
from mbf_mesh_nav.building.heights import HeightLimits, fitted, noise_of_points, settled, smoothed, without_false_ground
from mbf_mesh_nav.building.holes import without_holes
from mbf_mesh_nav.building.outliers import isolated_points, refuse_degenerate
from mbf_mesh_nav.building.slabs import over_unseen_ground, without_undersides
from mbf_mesh_nav.building.surface_patches import Grid, SurfacePatches
from mbf_mesh_nav.kernels.building.columns import first_heights, sort_into_cells, split_columns
from mbf_mesh_nav.kernels.building.quads import distances_to_faces, faces_of_patches
from mbf_mesh_nav.kernels.mesh.incidence import faces_of_vertices
from mbf_mesh_nav.kernels.mesh.topology import faces_across_edges, unit_face_normals
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.mesh.topology import group_of_each

POINTS_PER_CELL = 4.0
SMALLEST_CELL, LARGEST_CELL, CELL_STEP = 0.1, 1.0, 0.05
"""[m] What a tripod scans in the middle of a yard would do for cells of 5 cm: four times the vertices, less even."""
STOREY = 2.5
CROWN_UPWARD = 0.7071
"""Mean z of the unit normals below which a surface above ground is a crown."""
Step = Callable[[str], None]


class SurfaceParameters(ParameterModel):
    """How points become a surface; the defaults suit a robot of a metre's size outdoors."""

    cell: float = parameter(
        0.0,
        "Distance between the vertices; 0 = from the density, about four points a cell, 0.1 to 1 m.",
        unit="m",
        ge=0.0,
        le=10.0,
    )
    outlier_points: int = parameter(
        4, "Points with fewer points around them are errors; 1 = keep all. Around is up to twice the cell.", ge=1
    )
    clearance: float = parameter(
        CLEARANCE, "Free height that the robot needs; points above that are not obstacles.", unit="m", gt=0.1, le=20.0
    )
    step_height: float = parameter(
        0.2, "What stands up to this height is driven over, such as grass.", unit="m", ge=0.02, le=2.0
    )
    ground_thickness: float = parameter(
        0.1, "Points up to this height above the lowest of a cell are ground.", unit="m", gt=0.0, le=1.0
    )
    slab_thickness: float = parameter(
        0.5,
        "A bridge or ceiling is at most this thick; what is thicker and above ground is no surface.",
        unit="m",
        gt=0.0,
    )
    max_slope: float = parameter(70.0, "What is steeper is a wall and no surface.", unit="deg", gt=5.0, le=85.0)
    obstacle_points: int = parameter(2, "Points above a cell that make it an obstacle.", ge=1)
    hole_width: float = parameter(1.0, "Holes up to this width are filled; 0 = none.", unit="m", ge=0.0, le=20.0)
    least_area: float = parameter(10.0, "Smaller separate surfaces are left out.", unit="m^2", ge=0.0)
    decimation_bound: float = parameter(
        0.0, "Fewer vertices, whose faces stay this near to those of all; 0 = all vertices.", unit="m", ge=0.0, le=1.0
    )

    @field_validator("step_height")
    @classmethod
    def _leaves_room_for_obstacles(cls, step_height: float, info: ValidationInfo) -> float:
        """An obstacle is what stands between the height of a step and the clearance."""
        clearance = info.data.get("clearance", CLEARANCE)
        if step_height >= clearance:
            raise ValueError(f"less than the clearance of {clearance:g} m, got {step_height:g}")
        return step_height


@dataclass(frozen=True, eq=False)
class BuiltSurface:
    """A mesh, and what it came from.

    Attributes
    ----------
    vertices : (V, 3) float64
        [m], relative to the cloud's origin.
    faces : (F, 3) int32
    patches : SurfacePatches
        All of them, those of obstacles and of small surfaces included.
    points : (n, 3) float64
        Sorted as the patches number them, without outliers.
    is_outlier : (m,) bool
        Mask of the points given.
    is_obstacle, is_small, is_used : (P,) bool
        Patches that something stands on, of surfaces that are too small, and those that became vertices.
    distances : (n,) float32
        Of points above (+) and below (-) the faces [m]; NaN for points of no face, such as those of trees.
    height_errors : (V,) float64
        Standard errors of the heights of the vertices [m], see ``building.height_errors``.
    place_errors : (V,) float64
        Those of the heights of places on the faces around them [m].
    """

    vertices: FloatArray
    faces: IntArray
    patches: SurfacePatches
    points: FloatArray
    is_outlier: BoolArray
    is_obstacle: BoolArray
    is_small: BoolArray
    is_used: BoolArray
    distances: Float32Array
    height_errors: FloatArray
    place_errors: FloatArray


def build_surface(
    points: FloatArray, parameters: SurfaceParameters | None = None, on_step: Step = lambda name: None
) -> BuiltSurface:
    """Build the surface under points (n, 3) [m], z up.

    The same points in any order give the same mesh, to the last bit.

    Parameters
    ----------
    on_step : callable, optional
        Called with the name of each step before it begins. What it raises ends the building.

    Raises
    ------
    MeshError
        Too few points, all on one line, no surface among them, or too large a grid.
    """
    chosen = parameters or SurfaceParameters()
    refuse_degenerate(points)
    cell = chosen.cell or cell_for(points)
    on_step("outliers")
    is_outlier = isolated_points(points, 2.0 * cell, chosen.outlier_points)
    kept = points[~is_outlier] if is_outlier.any() else points
    if not len(kept):
        hint = "Give their unit with --scale, or choose a larger --cell"
        raise MeshError("point cloud", [f"all of its {len(points)} points are isolated"], hint)
    on_step("surfaces")
    grid = Grid.around(kept, cell)
    rise = cell * float(tan(np.radians(chosen.max_slope))) + chosen.ground_thickness
    patches, kept = _split(kept, grid, chosen, rise)
    limits = HeightLimits(0.0, chosen.ground_thickness, chosen.step_height, chosen.clearance, rise)
    # Only the ground's: of a slab that was seen from both sides half of the points are its underside.
    limits = limits.with_noise(noise_of_points(patches, kept, patches.is_ground, rise, rise))
    patches = without_false_ground(settled(patches, kept, limits), limits, chosen.obstacle_points)
    patches, kept_noise = smoothed(patches, limits)
    patches = fitted(patches, kept, limits, kept_noise.is_less)
    on_step("holes")
    patches = without_holes(patches, chosen.hole_width, rise, chosen.clearance)
    on_step("faces")
    is_obstacle = patches.standing >= chosen.obstacle_points
    links = patches.links(rise)
    faces = faces_of_patches(patches.heights, links, ~is_obstacle)
    is_kept = _is_large(patches, faces, chosen.least_area)
    if not is_kept.any():
        raise MeshError("point cloud", [f"there is no surface of {chosen.least_area:g} m² in it"], _hint_on(points))
    is_used, is_small = _of_faces(patches, faces[is_kept]), _of_faces(patches, faces[~is_kept])
    faces = faces[is_kept]
    on_step("error")
    arrays = (patches.firsts, patches.ends, patches.centres, patches.heights)
    distances = distances_to_faces(kept, *arrays, links, is_used, cell, limits.step)
    errors = [each[is_used] for each in height_errors(patches, distances, links, is_used, kept_noise)]
    vertices, faces = _compact(np.column_stack([patches.centres, patches.heights]), faces)
    return BuiltSurface(
        vertices, faces, patches, kept, is_outlier, is_obstacle, is_small & ~is_used, is_used, distances, *errors
    )


def _hint_on(points: FloatArray) -> str:
    """What may be wrong with points (n, 3) [m] without a surface: on their side, or all of one height; else empty."""
    extent = np.ptp(points, axis=0)
    flattest = "xyz"[int(np.argmin(extent))]
    if flattest != "z":
        return f"It is flattest along {flattest}: if that is up, choose --up {flattest}"
    return "A planar scanner sees walls and no ground; a 3D sensor is needed" if extent[2] < SMALLEST_CELL else ""


def cell_for(points: FloatArray) -> float:
    """Cell [m] that holds about ``POINTS_PER_CELL`` points of a surface where the cloud is typically dense.

    Points are counted in blocks of a square metre and the height of a storey, so that storeys do not add up.
    """
    block = np.floor((points - points.min(axis=0)) / (1.0, 1.0, STOREY)).astype(np.int64)
    _, rows, levels = (block.max(axis=0) + 1).tolist()
    _, counts = np.unique((block[:, 0] * rows + block[:, 1]) * levels + block[:, 2], return_counts=True)
    density = float(np.median(counts))
    steps = round(float(np.sqrt(POINTS_PER_CELL / density)) / CELL_STEP)
    return min(max(round(steps * CELL_STEP, 2), SMALLEST_CELL), LARGEST_CELL)


def _split(points: FloatArray, grid: Grid, chosen: SurfaceParameters, rise: float) -> tuple[SurfacePatches, FloatArray]:
    """Patches with their first heights, and the points in the patches' order."""
    by_height = np.argsort(points[:, 2], kind="stable")
    offsets, ordered = sort_into_cells(points, by_height, grid.corner, grid.cell, grid.columns, grid.rows)
    thickest = chosen.slab_thickness + rise
    cells, firsts, ends, kinds = split_columns(ordered, offsets, chosen.clearance, thickest)
    layers = cells, firsts, ends, kinds
    firsts, is_left = on_decks(ordered, grid, layers, chosen.ground_thickness, chosen.slab_thickness, thickest)
    cells, firsts, ends, kinds = cells[is_left], firsts[is_left], ends[is_left], kinds[is_left]
    bottoms, tops = ordered[firsts, 2], ordered[ends - 1, 2]
    unknown, standing = np.zeros(len(cells)), np.zeros(len(cells), dtype=np.int32)
    patches = SurfacePatches(grid, cells, kinds, firsts, ends, bottoms, tops, unknown, standing)
    patches = over_unseen_ground(patches, chosen.clearance, thickest)
    heights = first_heights(ordered, firsts, ends, patches.kinds, np.array([rise, chosen.ground_thickness]))
    return without_undersides(replace(patches, heights=heights), chosen.ground_thickness, rise), ordered


def _is_large(patches: SurfacePatches, faces: IntArray, least_area: float) -> BoolArray:
    """Mask (F,) of the faces of connected surfaces that are large enough and no crowns of trees.

    Surfaces are connected across edges. Those above ground that are mostly upper ends of thick runs of points, or
    steeper than 45 degrees on average, are crowns.
    """
    across = faces_across_edges(faces, *faces_of_vertices(faces, len(patches.cells)))
    face, corner = np.nonzero(across >= 0)
    groups = group_of_each(np.stack([face, across[face, corner]], axis=1), len(faces))
    counts = np.bincount(groups)
    tops, grounds = (
        np.bincount(groups, weights=mask[faces].sum(axis=1)) / (3.0 * counts)
        for mask in (patches.is_top, patches.is_ground)
    )
    areas = 0.5 * counts * patches.grid.cell * patches.grid.cell
    corners = np.column_stack([patches.centres, patches.heights])
    upward = np.bincount(groups, weights=unit_face_normals(corners, faces)[:, 2]) / counts
    is_crown = (grounds < 0.5) & ((tops > 0.5) | (upward < CROWN_UPWARD))
    return np.asarray(((areas >= least_area) & ~is_crown)[groups])


def _of_faces(patches: SurfacePatches, faces: IntArray) -> BoolArray:
    """Mask (P,) of the patches that are corners of faces (F, 3)."""
    mask = np.zeros(len(patches.cells), dtype=np.bool_)
    mask[faces] = True
    return mask


def _compact(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Vertices that belong to a face, in their order, and the faces in their numbering."""
    used, corners = np.unique(faces, return_inverse=True)
    return vertices[used], corners.reshape(-1, 3).astype(np.int32)
