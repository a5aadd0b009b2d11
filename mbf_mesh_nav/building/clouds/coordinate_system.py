"""Names of coordinate systems, by their form: nothing is transformed, so no register of them is needed.

Forms: a code of EPSG, well-known text (OGC 01-009 and ISO 19162) and the strings of the library PROJ. Whether a code
exists is not checked.
"""

from __future__ import annotations

import re

from mbf_mesh_nav.mesh.mesh_report import MeshError

LONGEST_NAME = 200
"""Characters of the name of a coordinate system, which is kept in the header of a map file."""
LEAST_CODE, GREATEST_CODE = 1024, 32766
"""Codes that EPSG gives."""
DEGREES = (4258, 4269, 4326, 4979)
"""Codes of the usual systems in degrees: ETRS89, NAD83, WGS 84 in two and three dimensions."""

CODE = re.compile(r"(?:EPSG:|urn:ogc:def:crs:EPSG:[\d.]*:)(\d+)(?:\+(\d+))?", re.IGNORECASE)
"""Of a whole system, or of its horizontal and its vertical part."""
PROJ_STRING = re.compile(r"(?:\+\w+(?:=[^\s+]\S*)?\s+)*\+(?:proj|init)=\w\S*(?:\s+\+\w+(?:=[^\s+]\S*)?)*")
DEGREES_OF_PROJ = re.compile(r"\+proj=(?:longlat|latlong|lonlat|latlon)\b")
WELL_KNOWN_TEXT = re.compile(
    r"(?:PROJCS|GEOGCS|GEOCCS|COMPD_CS|LOCAL_CS|(?:PROJ|PROJECTED|GEOG|GEOGRAPHIC|GEOD|GEODETIC|COMPOUND|BOUND|ENG|DERIVEDPROJ)CRS)"
    r'\s*\[.*"[^"]+".*\]',
    re.IGNORECASE | re.DOTALL,
)
DEGREES_OF_TEXT = re.compile(r"GEOG", re.IGNORECASE)
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
        The text has none of the forms, is too long, or is a system in degrees, in which no map can be.
    """
    given = text.strip()
    if not given:
        return ""
    name, is_degrees = "", False
    if match := CODE.fullmatch(given):
        codes = [int(code) for code in match.groups() if code]
        if all(LEAST_CODE <= code <= GREATEST_CODE for code in codes):
            name, is_degrees = f"EPSG:{'+'.join(map(str, codes))}", codes[0] in DEGREES
    elif WELL_KNOWN_TEXT.fullmatch(given) and given.count("[") == given.count("]"):
        name, is_degrees = name_of_text(given), DEGREES_OF_TEXT.match(given) is not None
    elif len(given) <= LONGEST_NAME and given.isascii() and given.isprintable() and PROJ_STRING.fullmatch(given):
        name, is_degrees = given, DEGREES_OF_PROJ.search(given) is not None
    if not name:
        raise MeshError("point cloud", [f"crs: {EXPECTED}, got {given!r:.60}"])
    if is_degrees:
        raise MeshError("point cloud", [f"crs: {name} is in degrees, a map is in metres; project the points first"])
    return name
