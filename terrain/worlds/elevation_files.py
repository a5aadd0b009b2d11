"""Read elevation models: the Jacksboro fault that comes with matplotlib, and files of four common formats.

All readers turn the raster so that y grows northwards (row 0 of every one of these formats is the northern edge),
put sample [0, 0] at the origin, and give degrees their length in metres at the raster's latitude. For a world to drive
in, ``read_dem`` fills voids from the nearest valid sample, because physics needs ground everywhere. For
a map, ``read_elevation`` leaves them: the mesh server takes it by the entry point ``mbf.elevation_readers``.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mbf_abstract.config.bounded_files import is_file, read_arrays
from mbf_abstract.geometry.survey import Survey
from terrain.worlds.elevation_surveys import (
    PIXEL_SCALE,
    degree_lengths,
    survey_of_grid,
    survey_of_tags,
    survey_of_tile,
)
from terrain.worlds.esri_ascii import read_header, read_heights
from terrain.worlds.generate import add_roughness
from terrain.worlds.heightfield import MAX_SAMPLES, Heightfield

MAX_VOID_SHARE = 0.5

ASCII_VOID = -9999.0
"""What an ESRI ASCII grid without a NODATA_value has for voids, by the format's definition."""
MAX_ASCII_BYTES_PER_SAMPLE = 64
HGT_VOID = -32768
TIFF_NO_DATA = 42113


class TerrainFileError(Exception):
    """A terrain file cannot be used; the text names the file and the reason."""

    def __init__(self, path: str | Path, reason: str) -> None:
        super().__init__(f"{path}: {reason}")
        self.path = path
        self.reason = reason

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """Keep the arguments when it is pickled for another process."""
        return type(self), (self.path, self.reason)


class Elevation(NamedTuple):
    """Heights (ny, nx) [m], the southern row first and NaN at voids, and the distances [m] between samples."""

    heights: NDArray[np.float64]
    dx: float
    dy: float


def jacksboro(
    size_m: float = 100.0, spacing: float | None = None, roughness: float = 0.0, rng: np.random.Generator | None = None
) -> Heightfield:
    """Real terrain: the Jacksboro fault (Tennessee), shrunk in all three directions to ``size_m`` [m] along x.

    The file ships with matplotlib (sample data, from the US national survey): 30 x 32 km with slopes up to 36
    degrees. Shrinking isotropically keeps those slopes and makes the hills the size of a robot's world.

    Parameters
    ----------
    size_m : float
        Length [m] of the shrunk terrain along x; along y it is 6 % longer. 100 gives samples 0.25 x 0.31 m apart.
    spacing : float, optional
        Sample again (bicubic) at this distance [m]; without it the survey's own samples are kept.
    roughness : float
        Root mean square height [m] of small fractal bumps to add, so that wheels meet rough ground; needs ``rng``.
    rng : numpy Generator, optional
        Draws the bumps.
    """
    try:
        from matplotlib import cbook
    except ImportError as error:
        text = "the elevations of Jacksboro come with matplotlib"
        raise ImportError(f"{text}: pip install 'mbf-flex[sim]' ({error})") from error
    with np.load(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False), allow_pickle=False) as data:
        elevation, degrees = np.asarray(data["elevation"]), float(data["dx"])
        latitude = 0.5 * (float(data["ymin"]) + float(data["ymax"]))
    dx, dy = (degrees * length for length in degree_lengths(latitude))
    terrain = _filled(_northern_row_first(elevation, dx, dy))
    terrain = terrain.scaled(size_m / terrain.size[0])
    terrain = terrain.with_heights(terrain.heights - terrain.heights.min())
    if spacing is not None:
        terrain = terrain.resample(spacing)
    if roughness > 0.0:
        if rng is None:
            raise ValueError("roughness is random: give a generator `rng`")
        terrain = add_roughness(terrain, rng, roughness)
    return terrain


def read_dem(path: str | Path) -> Heightfield:
    """Read an elevation model and fill its voids; files as in ``read_elevation``.

    Raises TerrainFileError as that does, and where more than half of the raster is void.
    """
    try:
        return _filled(read_elevation(path))
    except ValueError as error:
        raise TerrainFileError(path, str(error)) from error


def read_elevation(path: str | Path, max_samples: int = MAX_SAMPLES) -> Elevation:
    """Read an elevation model by its file name's ending; voids are NaN.

    Parameters
    ----------
    path : path
        ``.asc`` (ESRI ASCII grid), ``.hgt`` (SRTM tile), ``.tif``/``.tiff`` (GeoTIFF) or ``.npz`` with ``z`` and
        ``dx``, ``dy`` [m], row 0 in the north.
    max_samples : int
        Larger rasters are refused before their heights are read.

    Raises
    ------
    TerrainFileError
        Missing file, unknown ending, too many samples, or contents that do not match the ending.
    """
    path = Path(path)
    readers = {".asc": _read_esri_ascii, ".hgt": _read_hgt, ".npz": _read_npz}
    readers |= {".tif": _read_geotiff, ".tiff": _read_geotiff}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise TerrainFileError(path, f"unknown ending '{path.suffix}'; known: {', '.join(sorted(readers))}")
    if not is_file(path):
        raise TerrainFileError(path, "there is no such file")
    try:
        return reader(path, max_samples)
    except TerrainFileError:
        raise
    except (OSError, ValueError, KeyError, IndexError, OverflowError) as error:
        raise TerrainFileError(path, f"cannot be read: {error}") from error


def _northern_row_first(raster: NDArray[Any], dx: float, dy: float, void: float | None = None) -> Elevation:
    """Flip to y up and mark voids by NaN."""
    heights = raster.astype(np.float64)[::-1]
    bad = ~np.isfinite(heights)
    if void is not None:
        bad |= heights == void
    return Elevation(np.where(bad, np.nan, heights), dx, dy)


def _filled(elevation: Elevation) -> Heightfield:
    """Fill voids from the nearest valid sample; raises ValueError where more than half of the raster is void."""
    heights, bad = elevation.heights, np.isnan(elevation.heights)
    if bad.mean() > MAX_VOID_SHARE:
        got = "got {} voids of {} x {}; no number and the file's no-data value are voids".format(bad.sum(), *bad.shape)
        raise ValueError(f"expected heights at half of the samples or more, {got}")
    if bad.any():
        _, (rows, columns) = ndimage.distance_transform_edt(bad, return_indices=True)
        heights = heights[rows, columns]
    return Heightfield(heights.astype(np.float32), elevation.dx, elevation.dy)


def _refuse_size(path: Path, rows: int, columns: int, max_samples: int) -> None:
    if min(rows, columns) < 2:
        raise TerrainFileError(path, f"expected at least 2 x 2 heights, got {rows} x {columns}")
    if rows * columns > max_samples:
        raise TerrainFileError(path, f"{rows} x {columns} heights, the limit is {max_samples}")


def _read_esri_ascii(path: Path, max_samples: int) -> Elevation:
    header = read_header(path)
    missing = [key for key in ("ncols", "nrows", "cellsize") if key not in header]
    if missing:
        raise TerrainFileError(path, f"expected {', '.join(missing)} in the header, got {', '.join(header) or 'none'}")
    if not header["cellsize"] > 0.0:
        raise TerrainFileError(path, f"expected a cellsize above 0 in the header, got {header['cellsize']:g}")
    shape = int(header["nrows"]), int(header["ncols"])
    _refuse_size(path, *shape, max_samples)
    if path.stat().st_size > MAX_ASCII_BYTES_PER_SAMPLE * (shape[0] * shape[1] + len(header)):
        got = f"{path.stat().st_size} bytes of text"
        raise TerrainFileError(path, f"expected {shape[0]} x {shape[1]} heights, got {got}")
    values = read_heights(path, header)
    if values.size != shape[0] * shape[1]:
        raise TerrainFileError(path, f"expected {shape[0]} x {shape[1]} heights as in the header, got {values.size}")
    void, size = header.get("nodata_value", ASCII_VOID), header["cellsize"]
    dx, dy = (size * length for length in _units(survey_of_grid(header)))
    return _northern_row_first(values.reshape(shape), dx, dy, void)


def _units(survey: Survey | None) -> tuple[float, float]:
    return (1.0, 1.0) if survey is None else survey.units


def _read_hgt(path: Path, max_samples: int) -> Elevation:
    """SRTM: one degree square of big-endian int16; the name holds the south-west corner, e.g. ``N44W072``."""
    survey = survey_of_tile(path.stem)
    if survey is None:
        raise TerrainFileError(
            path, f"expected a name that starts with the corner of the SRTM tile, such as N44W072, got {path.stem!r}"
        )
    size = path.stat().st_size
    side = math.isqrt(size // 2)
    if side < 2 or 2 * side * side != size:
        raise TerrainFileError(path, f"expected a square of 16-bit heights, got {size} bytes")
    _refuse_size(path, side, side, max_samples)
    values = np.fromfile(path, dtype=">i2")
    dx, dy = (length / (side - 1) for length in survey.units)
    return _northern_row_first(values.reshape(side, side), dx, dy, HGT_VOID)


def _read_geotiff(path: Path, max_samples: int) -> Elevation:
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        try:
            with Image.open(path, formats=("TIFF",)) as image:
                tags = dict(image.tag_v2)  # type: ignore[attr-defined]
                _refuse_size(path, image.height, image.width, max_samples)
                raster = np.asarray(image)
        except (Image.DecompressionBombError, Image.DecompressionBombWarning, SyntaxError) as error:
            raise TerrainFileError(path, f"cannot be read: {error}") from error
    if raster.ndim != 2:
        raise TerrainFileError(path, f"expected one band of heights, got {raster.shape[-1]}")
    if PIXEL_SCALE not in tags:
        raise TerrainFileError(path, "expected a GeoTIFF with a pixel scale (tag 33550), got none")
    units = _units(survey_of_tags(tags, len(raster)))
    dx, dy = (float(size) * length for size, length in zip(tags[PIXEL_SCALE][:2], units, strict=True))
    no_data = tags.get(TIFF_NO_DATA)
    return _northern_row_first(raster, dx, dy, None if no_data is None else float(str(no_data).strip("\0 ")))


def _read_npz(path: Path, max_samples: int) -> Elevation:
    keys = ("z", "dx", "dy")
    data = read_arrays(path, 8 * (max_samples + 2), keys)
    if missing := [key for key in keys if key not in data]:
        raise TerrainFileError(path, f"expected the arrays {', '.join(keys)}, got no {', no '.join(missing)}")
    if data["z"].ndim != 2:
        raise TerrainFileError(path, f"z: expected rows and columns, got the shape {data['z'].shape}")
    _refuse_size(path, len(data["z"]), data["z"].shape[1], max_samples)
    return _northern_row_first(data["z"], float(data["dx"]), float(data["dy"]))
