"""Where an elevation model lies on the earth: its south-western sample, the length of its units, its coordinate system.

A GeoTIFF states all of it (OGC 19-008: tie point, pixel scale, keys), an ESRI ASCII grid its corner, and an SRTM tile
the corner in its name. Degrees have the length of those at the middle of the raster.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mbf_abstract.geometry.survey import Survey
from terrain.worlds.esri_ascii import is_in_degrees, read_header

METRES_PER_DEGREE = 111_320.0  # along a meridian, and along the equator; good to half a percent everywhere
WGS_84 = "EPSG:4326"

PIXEL_SCALE, TIE_POINT, GEO_KEYS = 33550, 33922, 34735
MODEL_TYPE, RASTER_TYPE, GEOGRAPHIC_SYSTEM, PROJECTED_SYSTEM, LINEAR_UNIT = 1024, 1025, 2048, 3072, 3076
GEOGRAPHIC, PIXEL_IS_POINT = 2, 2
USER_DEFINED = 32767
FEET = {9002: 0.3048, 9003: 1200.0 / 3937.0}
"""Length [m] of the foot and of the survey foot of the United States, by their codes of EPSG."""


def degree_lengths(latitude: float) -> tuple[float, float]:
    """Length [m] of one degree of longitude and of latitude at ``latitude`` [degrees]."""
    return METRES_PER_DEGREE * math.cos(math.radians(latitude)), METRES_PER_DEGREE


def survey_of(path: Path) -> Survey | None:
    """Survey of a file that can be read as an elevation model, by its ending; None where it states none."""
    ending = path.suffix.lower()
    if ending == ".asc":
        return survey_of_grid(read_header(path))
    if ending == ".hgt":
        return survey_of_tile(path.stem)
    if ending not in (".tif", ".tiff"):
        return None
    from PIL import Image

    with Image.open(path, formats=("TIFF",)) as image:
        return survey_of_tags(dict(image.tag_v2), image.height)  # type: ignore[attr-defined]


def survey_of_grid(header: Mapping[str, float]) -> Survey | None:
    """Survey of an ESRI ASCII grid; its corner is that of a cell, its centre that of a sample."""
    size = header["cellsize"]
    x, y = header.get("xllcenter"), header.get("yllcenter")
    if "xllcorner" in header and "yllcorner" in header:
        x, y = header["xllcorner"] + 0.5 * size, header["yllcorner"] + 0.5 * size
    if x is None or y is None:
        return None
    units = degree_lengths(y + 0.5 * size * (header["nrows"] - 1)) if is_in_degrees(header) else (1.0, 1.0)
    return Survey((x, y, 0.0), units)


def survey_of_tile(name: str) -> Survey | None:
    """Survey of a tile of SRTM, one degree square, by its name, such as ``N44W072``; None for other names."""
    found = re.match(r"([NS])(\d{2})([EW])(\d{3})", name, re.IGNORECASE)
    if found is None:
        return None
    latitude = float(found[2]) * (1.0 if found[1].upper() == "N" else -1.0)
    longitude = float(found[4]) * (1.0 if found[3].upper() == "E" else -1.0)
    return Survey((longitude, latitude, 0.0), degree_lengths(latitude + 0.5), WGS_84)


def survey_of_tags(tags: Mapping[int, Any], rows: int) -> Survey | None:
    """Survey of a GeoTIFF by its tags; None without a tie point."""
    if PIXEL_SCALE not in tags or len(tie := tags.get(TIE_POINT, ())) < 6:
        return None
    stored = tags.get(GEO_KEYS, ())
    keys = {stored[i]: stored[i + 3] for i in range(4, len(stored) - 3, 4) if stored[i + 1] == 0}
    dx, dy = float(tags[PIXEL_SCALE][0]), float(tags[PIXEL_SCALE][1])
    half = 0.0 if keys.get(RASTER_TYPE) == PIXEL_IS_POINT else 0.5
    x = float(tie[3]) + (half - float(tie[0])) * dx
    y = float(tie[4]) - (rows - 1 + half - float(tie[1])) * dy
    geographic = keys.get(MODEL_TYPE) == GEOGRAPHIC
    code = keys.get(GEOGRAPHIC_SYSTEM if geographic else PROJECTED_SYSTEM, 0)
    foot = FEET.get(keys.get(LINEAR_UNIT, 0), 1.0)
    units = degree_lengths(y + 0.5 * dy * (rows - 1)) if geographic else (foot, foot)
    return Survey((x, y, 0.0), units, f"EPSG:{code}" if 0 < code < USER_DEFINED else "")
