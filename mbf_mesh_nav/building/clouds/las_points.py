"""Surveys in LAS and LAZ files (ASPRS LAS 1.0 to 1.4), through laspy; the extra ``maps``.

Coordinates are whole numbers times a scale plus an offset, so nothing is lost far from the origin. Points that the
survey itself classifies as noise (classes 7 and 18) or withholds are left out.
"""

from __future__ import annotations

import re
import struct
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from mbf_mesh_nav.building.clouds.coordinate_system import DEGREES_OF_TEXT, name_of_text
from mbf_mesh_nav.building.clouds.stored_points import StoredPoints, refuse_count
from mbf_mesh_nav.mesh.mesh_report import MeshError

PACKAGES = {".las": ("laspy",), ".laz": ("laspy", "lazrs")}
NOISE_CLASSES = (7, 18)
CHUNK_POINTS = 1_000_000
GEO_KEYS, WELL_KNOWN_TEXT = 34735, 2112
MODEL_TYPE, PROJECTED_SYSTEM, LINEAR_UNIT, VERTICAL_UNIT, GEOGRAPHIC = 1024, 3072, 3076, 4099, 2
USER_DEFINED = 32767
UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}
"""Length [m] of the linear units of GeoTIFF keys: metre, foot, survey foot of the United States."""

LENGTH_UNIT = re.compile(r'UNIT\["[^"]*(?:met|foot|feet|ft)[^"]*",\s*([0-9.eE+-]+)', re.IGNORECASE)
"""A linear unit of a coordinate system as well-known text, with its length [m]."""
SMALLEST_HEADER = 227
"""Bytes of the header of LAS 1.0."""
TABLE_PLACE = struct.Struct("<q")
"""Where the table of the compressed chunks begins, from the start of the file: the first number of LAZ points."""


def read_las_points(path: Path, max_points: int) -> StoredPoints:
    """Read the points of a LAS or LAZ file.

    Raises
    ------
    MeshError
        laspy is not installed, the file is no LAS, cut off, has more than ``max_points`` points, is in degrees,
        or its header turns no number into a coordinate.
    """
    if missing := [name for name in PACKAGES[path.suffix.lower()] if find_spec(name) is None]:
        raise MeshError(str(path), [f"needs {' and '.join(missing)}: pip install 'mbf-flex[maps]'"])
    import laspy

    if (size := path.stat().st_size) < SMALLEST_HEADER:
        text = f"the file is cut off within its header: expected at least {SMALLEST_HEADER} bytes, found {size}"
        raise MeshError(str(path), [text])
    try:
        with laspy.open(path) as reader:
            header = reader.header
            count, size = int(header.point_count), int(header.point_format.size)
            refuse_count(path, count, max_points)
            _refuse_scales(path, header)
            if not header.are_points_compressed:
                found = (path.stat().st_size - int(header.offset_to_point_data)) // size
                if found < count:
                    raise MeshError(str(path), [f"the file is cut off: expected {count} points, found {found}"])
            else:
                _refuse_cut_chunks(path, int(header.offset_to_point_data), count)
            text, keys = _stated_system(header)
            unit = _unit(path, text, keys)
            points, is_kept = _read_chunks(path, reader, count)
    except MeshError:
        raise
    except Exception as error:  # laspy, lazrs and struct each raise their own for damaged files
        raise MeshError(str(path), [f"is cut off, damaged or no LAS: {type(error).__name__}: {error}"]) from error
    dropped = count - int(is_kept.sum())
    notes = (f"{dropped} points are classified as noise or withheld",) if dropped else ()
    return StoredPoints(points[is_kept] if dropped else points, notes=notes, unit=unit, crs=_crs(text, keys))


def _refuse_scales(path: Path, header: Any) -> None:
    """Refuse a header by which no whole number becomes a coordinate."""
    scales, offsets = np.asarray(header.scales, dtype=float), np.asarray(header.offsets, dtype=float)
    if not (np.isfinite(scales).all() and (scales > 0.0).all()):
        raise MeshError(str(path), [f"expected scales above 0 in its header, got {scales.tolist()}"])
    if not np.isfinite(offsets).all():
        raise MeshError(str(path), [f"expected finite offsets in its header, got {offsets.tolist()}"])


def _refuse_cut_chunks(path: Path, points_begin: int, count: int) -> None:
    """Refuse a LAZ file that ends before the table of its chunks, which is the last thing that belongs to the points.

    A writer that cannot go back in its file leaves -1 there and puts the place at the end; such a file is not judged.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(points_begin)
        first = file.read(TABLE_PLACE.size)
    (table,) = TABLE_PLACE.unpack(first) if len(first) == TABLE_PLACE.size else (points_begin + TABLE_PLACE.size,)
    if size <= table or len(first) < TABLE_PLACE.size:
        promised = f"expected {count} compressed points up to byte {table} and a table of them"
        raise MeshError(str(path), [f"the file is cut off: {promised}, found {size} bytes"])


def _read_chunks(path: Path, reader: Any, count: int) -> tuple[Any, Any]:
    points, is_kept = np.empty((count, 3), dtype=np.float64), np.ones(count, dtype=np.bool_)
    start = 0
    for chunk in reader.chunk_iterator(CHUNK_POINTS):
        end = start + len(chunk)
        if end > count:
            break
        for axis, name in enumerate("xyz"):
            points[start:end, axis] = chunk[name]
        is_kept[start:end] = ~np.isin(np.asarray(chunk.classification), NOISE_CLASSES)
        is_kept[start:end] &= np.asarray(chunk.withheld) == 0
        start = end
    if start != count:
        raise MeshError(str(path), [f"the file is cut off: expected {count} points, found {start}"])
    return points, is_kept


def _stated_system(header: Any) -> tuple[str, dict[int, int]]:
    """Coordinate system of a file as well-known text and as GeoTIFF keys; both may be empty."""
    records = {int(record.record_id): record for record in [*header.vlrs, *(header.evlrs or ())]}
    text = str(getattr(records.get(WELL_KNOWN_TEXT), "string", ""))
    keys = {int(key.id): int(key.value_offset) for key in getattr(records.get(GEO_KEYS), "geo_keys", ())}
    return text, keys


def _crs(text: str, keys: dict[int, int]) -> str:
    """Code or name of the coordinate system, "" if the file states none."""
    name = name_of_text(text)
    code = keys.get(PROJECTED_SYSTEM, 0)
    return name if name.startswith("EPSG:") or not 0 < code != USER_DEFINED else f"EPSG:{code}"


def _unit(path: Path, text: str, keys: dict[int, int]) -> float:
    """Length [m] of the file's unit by its coordinate system, 0 if it states none."""
    if keys.get(MODEL_TYPE) == GEOGRAPHIC or DEGREES_OF_TEXT.match(text):
        raise MeshError(str(path), ["its coordinates are degrees; project them to metres first"])
    lengths = [float(length) for length in LENGTH_UNIT.findall(text)]
    if not lengths and keys.get(LINEAR_UNIT) in UNITS:
        lengths = [UNITS[keys[unit]] for unit in (LINEAR_UNIT, VERTICAL_UNIT) if keys.get(unit) in UNITS]
    if len(set(lengths)) > 1:
        text = ", ".join(f"{length:g} m" for length in lengths)
        raise MeshError(str(path), [f"its coordinate system mixes units ({text}); convert it to one unit first"])
    return lengths[0] if lengths else 0.0
