"""What a built map keeps beside its triangles, in comments of its PLY header: origin, errors, coordinate system."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

MAX_HEADER_BYTES = 2**16
ORIGIN, ERROR = b"comment mbf_origin", b"comment mbf_error"
HEIGHT_ERROR, CRS = b"comment mbf_height_error", b"comment mbf_crs"


class MapHeader(NamedTuple):
    """Facts of a built map [m].

    Attributes
    ----------
    origin : tuple of float
        Where the map's (0, 0, 0) lies in the coordinates of its survey.
    error_rms, error_95 : float
        Distance of the surveyed points from the surface: root mean square, and what 95 % of them keep.
    height_error : float
        Standard error of the heights of the vertices, root mean square; 0 = unknown. Layers narrow their limits by it
        unless the file has that of each vertex, see ``files.vertex_errors``.
    crs : str
        Coordinate system of the survey, such as "EPSG:25832"; "" = unknown.
    """

    origin: tuple[float, float, float]
    error_rms: float
    error_95: float
    height_error: float = 0.0
    crs: str = ""


def header_comments(header: MapHeader) -> list[str]:
    """Lines of a PLY header that hold the facts."""
    origin = " ".join(repr(value) for value in header.origin)
    lines = [f"{ORIGIN.decode()} {origin}", f"{ERROR.decode()} {header.error_rms!r} {header.error_95!r}"]
    lines.append(f"{HEIGHT_ERROR.decode()} {header.height_error!r}")
    return [*lines, f"{CRS.decode()} {header.crs}"] if header.crs else lines


def read_map_header(path: Path) -> MapHeader | None:
    """Facts of a built map; None for every other file, also where there is none."""
    if path.suffix.lower() != ".ply" or not path.is_file():
        return None
    with path.open("rb") as file:
        lines = file.read(MAX_HEADER_BYTES).partition(b"end_header")[0].splitlines()
    try:
        x, y, z = _numbers(lines, ORIGIN)
        error_rms, error_95 = _numbers(lines, ERROR)
        (height_error,) = _numbers(lines, HEIGHT_ERROR) or [0.0]
    except ValueError:
        return None
    if min(error_rms, error_95, height_error) < 0.0:  # it would widen the limits of layers
        return None
    crs = [line[len(CRS) :].decode("ascii", "replace").strip() for line in lines if line.startswith(CRS + b" ")]
    return MapHeader((x, y, z), error_rms, error_95, height_error, crs[0] if crs else "")


def _numbers(lines: list[bytes], key: bytes) -> list[float]:
    values = [float(word) for line in lines if line.startswith(key + b" ") for word in line[len(key) :].split()]
    if not all(map(math.isfinite, values)):
        raise ValueError(f"{key.decode()}: expected finite numbers")
    return values
