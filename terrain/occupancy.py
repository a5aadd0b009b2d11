"""Occupancy grids as worlds need them: read from map_server files, turned into walls.

The costmap server has its own, stricter reader; this small one keeps ``terrain`` free of it. Cells are indexed
``[iy, ix]`` from the lower left corner, as on a map with y up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from mbf_abstract.bounded_files import special_file
from terrain.solids import BOX_CORNERS, BOX_FACES

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

MAX_CELLS = 100_000_000


class OccupancyFileError(Exception):
    """A map file cannot be used; the text names the file and the reason."""

    def __init__(self, path: str | Path, reason: str) -> None:
        super().__init__(f"{path}: {reason}")


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """What is known of a floor.

    Attributes
    ----------
    occupied, free : (ny, nx) bool
        A cell that is neither is unknown.
    resolution : float
        Cell size [m].
    origin_x, origin_y : float
        Lower left corner of cell [0, 0] [m].
    """

    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]
    resolution: float
    origin_x: float = 0.0
    origin_y: float = 0.0

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Extent x_min, x_max, y_min, y_max [m]."""
        ny, nx = self.occupied.shape
        x_max, y_max = self.origin_x + nx * self.resolution, self.origin_y + ny * self.resolution
        return self.origin_x, x_max, self.origin_y, y_max

    def is_free(self, x: float, y: float) -> bool:
        """Whether the cell at (x, y) [m] is known to be free."""
        ix = math.floor((x - self.origin_x) / self.resolution)
        iy = math.floor((y - self.origin_y) / self.resolution)
        ny, nx = self.free.shape
        return 0 <= ix < nx and 0 <= iy < ny and bool(self.free[iy, ix])


def read_occupancy(path: str | Path) -> OccupancyGrid:
    """Read a map_server yaml and its image.

    Parameters
    ----------
    path : path
        The yaml: ``image``, ``resolution``, ``origin``, ``negate``, ``occupied_thresh``, ``free_thresh``. A cell with
        occupancy above the one threshold is occupied, below the other free (map_server's trinary mode).

    Raises
    ------
    OccupancyFileError
        A file is missing or is not what it should be, or the map is rotated.
    """
    path = Path(path)
    header = _read_header(path)
    pixels = _read_image(path, path.parent / str(header["image"]))
    occupancy = pixels if header.get("negate", 0) else 1.0 - pixels
    occupancy = occupancy[::-1]  # the first row of an image is the far end of y
    try:
        resolution = float(header["resolution"])
        origin = [float(value) for value in header["origin"]]
        occupied_above, free_below = float(header["occupied_thresh"]), float(header["free_thresh"])
    except (TypeError, ValueError) as error:
        raise OccupancyFileError(path, f"has a value that is no number: {error}") from error
    if not (math.isfinite(resolution) and resolution > 0.0):
        raise OccupancyFileError(path, f"resolution must be positive, got {resolution}")
    if len(origin) != 3 or origin[2] != 0.0:
        raise OccupancyFileError(path, f"origin must be [x, y, 0], got {origin}")
    return OccupancyGrid(occupancy > occupied_above, occupancy < free_below, resolution, origin[0], origin[1])


def _read_header(path: Path) -> dict[str, Any]:
    try:
        header = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise OccupancyFileError(path, f"cannot be read: {error}") from error
    if not isinstance(header, dict):
        raise OccupancyFileError(path, "is not a mapping of map_server keys")
    needed = ("image", "resolution", "origin", "occupied_thresh", "free_thresh")
    missing = [key for key in needed if key not in header]
    if missing:
        raise OccupancyFileError(path, f"lacks {', '.join(missing)}")
    return header


def _read_image(path: Path, image_path: Path) -> FloatArray:
    """Brightness 0..1 of each pixel (ny, nx), row 0 on top."""
    if kind := special_file(image_path):
        raise OccupancyFileError(path, f"image {image_path.name} is {kind}")
    try:
        with Image.open(image_path, formats=("PPM", "PNG", "BMP")) as image:
            if image.width * image.height > MAX_CELLS:
                raise OccupancyFileError(path, f"image {image_path.name} has {image.width} x {image.height} pixels")
            return np.asarray(image.convert("L"), dtype=np.float64) / 255.0
    except (OSError, SyntaxError, ValueError) as error:
        raise OccupancyFileError(path, f"image {image_path.name} cannot be read: {error}") from error


def merge_rectangles(occupied: NDArray[np.bool_]) -> IntArray:
    """Cover the occupied cells with few rectangles that do not overlap.

    Parameters
    ----------
    occupied : (ny, nx) bool

    Returns
    -------
    rectangles : (n, 4) int32
        Cell ranges ``ix_begin, iy_begin, ix_end, iy_end``, ends excluded. Runs of a row that reappear with the same
        ends in the next row are joined: greedy, not minimal, and linear in the number of runs.
    """
    open_runs: dict[tuple[int, int], int] = {}
    rectangles: list[tuple[int, int, int, int]] = []
    for iy, row in enumerate(np.vstack([occupied, np.zeros((1, occupied.shape[1]), dtype=bool)])):
        changes = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
        runs = {(int(begin), int(end)) for begin, end in changes.reshape(-1, 2)}
        for begin, end in sorted(open_runs.keys() - runs):
            rectangles.append((begin, open_runs.pop((begin, end)), end, iy))
        for run in runs - open_runs.keys():
            open_runs[run] = iy
    return np.array(rectangles, dtype=np.int32).reshape(-1, 4)


def wall_triangles(grid: OccupancyGrid, height: float = 2.0) -> tuple[FloatArray, IntArray]:
    """Extrude the occupied cells into one mesh of boxes from z = 0 to ``height`` [m].

    One mesh with all walls steps three times as fast in Bullet as a body per box.

    Returns
    -------
    vertices : (8 n, 3) float64
        [m]
    faces : (12 n, 3) int32
    """
    rectangles = merge_rectangles(grid.occupied).astype(np.float64)
    low = np.array([grid.origin_x, grid.origin_y]) + rectangles[:, :2] * grid.resolution
    high = np.array([grid.origin_x, grid.origin_y]) + rectangles[:, 2:] * grid.resolution
    count = len(rectangles)
    centres = np.column_stack([0.5 * (low + high), np.full(count, 0.5 * height)])
    sizes = np.column_stack([high - low, np.full(count, height)])
    vertices = (centres[:, None, :] + BOX_CORNERS * sizes[:, None, :]).reshape(-1, 3)
    faces = (BOX_FACES + 8 * np.arange(count, dtype=np.int32)[:, None, None]).reshape(-1, 3)
    return vertices, faces
