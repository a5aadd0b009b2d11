"""Names of coordinate systems that users give, checked by their form and by the register in ``map_projections``.

Forms: a code of EPSG, well-known text (OGC 01-009 and ISO 19162) and the strings of the library PROJ. Refused are what
has none of the forms, what PROJ does not know, and systems that no map is in: in degrees, around the earth's centre, of
heights alone. Nothing is transformed.
"""

from __future__ import annotations

import re

from mbf_mesh_nav.building.clouds.map_projections import registered
from mbf_mesh_nav.mesh.mesh_report import MeshError

LONGEST_NAME = 200
"""Characters of the name of a coordinate system, which is kept in the header of a map file."""
LEAST_CODE, GREATEST_CODE = 1024, 32766
"""Codes that EPSG gives."""
CODE = re.compile(r"(?:EPSG:|urn:ogc:def:crs:EPSG:[\d.]*:)(\d+)(?:\+(\d+))?", re.IGNORECASE)
"""Of a whole system, or of its horizontal and its vertical part."""
PROJ_STRING = re.compile(r"(?:\+\w+(?:=[^\s+]\S*)?\s+)*\+(?:proj|init)=\w\S*(?:\s+\+\w+(?:=[^\s+]\S*)?)*")
DEGREES_OF_PROJ = re.compile(r"\+proj=(?:longlat|latlong|lonlat|latlon)\b")
WELL_KNOWN_TEXT = re.compile(
    r"(?:PROJCS|GEOGCS|GEOCCS|COMPD_CS|LOCAL_CS|(?:PROJ|PROJECTED|GEOG|GEOGRAPHIC|GEOD|GEODETIC|COMPOUND|BOUND|ENG|DERIVEDPROJ)CRS)"
    r'\s*\[.*"[^"]+".*\]',
    re.IGNORECASE | re.DOTALL,
)
DEGREES_OF_TEXT = re.compile(r'\s*(?:(?:COMPD_CS|COMPOUNDCRS)\s*\[\s*"[^"]*"\s*,\s*)?GEOG', re.IGNORECASE)
GEOCENTRIC_FORM = re.compile(r"GEOCCS|\+proj=(?:geocent|cart)\b", re.IGNORECASE)
ZONE_OF_PROJ = re.compile(r"\+proj=utm\b(?:.*\s)?\+zone=(\S+)|\+zone=(\S+)\s.*\+proj=utm\b")
"""The zone of a system of UTM, of which there are 60."""
CODE_OF_TEXT = re.compile(r'(?:AUTHORITY\["EPSG",\s*"?(\d+)"?\]|ID\["EPSG",\s*(\d+)\])\s*\]\s*$')
"""The code of a whole coordinate system, which stands at the end of its text."""
NAME_OF_TEXT = re.compile(r'^\s*\w+\s*\["([^"]+)"')
EXPECTED = "expected a code such as EPSG:25832, well-known text or a PROJ string such as '+proj=utm +zone=32'"


def name_of_text(text: str) -> str:
    """Code or name of a coordinate system as well-known text, at most ``LONGEST_NAME`` of ASCII; "" if it has none."""
    if code := CODE_OF_TEXT.search(text):
        return f"EPSG:{code.group(1) or code.group(2)}"
    name = NAME_OF_TEXT.search(text)
    words = " ".join(name.group(1).split()) if name is not None else ""
    return "".join(one if one.isascii() and one.isprintable() else "?" for one in words[:LONGEST_NAME])


def given_system(text: str) -> str:
    """The name under which a map keeps the coordinate system that a user gives; "" for none.

    Well-known text becomes its code, or its name where it has no code.

    Raises
    ------
    MeshError
        The text has none of the forms or is too long; or there is no such system, or it is in degrees, around the
        earth's centre or of heights alone, in which no map can be; or pyproj is not installed.
    """
    given = text.strip()
    if not given:
        return ""
    name, is_degrees, is_geocentric = "", False, GEOCENTRIC_FORM.match(given) is not None
    if match := CODE.fullmatch(given):
        codes = [int(code) for code in match.groups() if code]
        if not all(LEAST_CODE <= code <= GREATEST_CODE for code in codes):
            text = f"expected a code of EPSG from {LEAST_CODE} to {GREATEST_CODE}, got {given!r:.60}"
            raise MeshError("crs", [text])
        name = f"EPSG:{'+'.join(map(str, codes))}"
    elif WELL_KNOWN_TEXT.fullmatch(given) and given.count("[") == given.count("]"):
        name, is_degrees = name_of_text(given), DEGREES_OF_TEXT.match(given) is not None
    elif len(given) <= LONGEST_NAME and given.isascii() and given.isprintable() and PROJ_STRING.fullmatch(given):
        name, is_degrees = given, DEGREES_OF_PROJ.search(given) is not None
        is_geocentric = GEOCENTRIC_FORM.search(given) is not None
        _refuse_zone(given)
    if not name:
        raise MeshError("crs", [f"{EXPECTED}, got {given!r:.60}"])
    system = None if is_degrees or is_geocentric else registered(name if name.startswith("EPSG:") else given)
    if is_degrees or (system is not None and system.is_geographic):
        raise MeshError("crs", [f"{name} is in degrees, a map is in metres; project the points first"])
    if is_geocentric or (system is not None and system.is_geocentric):
        text = f"{name} has its origin in the earth's centre, where z is not up; project the points first"
        raise MeshError("crs", [text])
    if system is not None and system.is_vertical and not system.is_compound:
        raise MeshError("crs", [f"{name} is of heights alone; give the one of x and y, or both as A+B"])
    return name


def _refuse_zone(given: str) -> None:
    """Refuse a PROJ string of UTM whose zone there is not."""
    match = ZONE_OF_PROJ.search(given)
    zone = match and (match.group(1) or match.group(2))
    if zone and not (zone.isdecimal() and 1 <= int(zone) <= 60):
        raise MeshError("crs", [f"expected a zone of UTM from 1 to 60, got {zone!r:.60}"])
