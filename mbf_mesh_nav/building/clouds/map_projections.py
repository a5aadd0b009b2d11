"""What PROJ and its copy of the EPSG register know of coordinate systems, through pyproj; the extra ``maps``.

Two systems contradict each other if the same coordinates are other places in them: another projection, other parameters
of it, another ellipsoid. Datums on one ellipsoid are no contradiction, such as ETRS89 and WGS 84, a metre apart.
"""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING

from mbf_mesh_nav.mesh.mesh_report import MeshError

if TYPE_CHECKING:
    from pyproj import CRS

SAME_ELLIPSOID = 0.5
"""Difference of the semi-major axes [m]; that of GRS 80 and WGS 84 is 0, of those of older surveys 60 and more."""


def registered(text: str) -> CRS:
    """The coordinate system of a code, well-known text, PROJ string or name.

    Raises
    ------
    MeshError
        There is no such system, or pyproj is not installed.
    """
    try:
        from pyproj import CRS
        from pyproj.exceptions import CRSError
    except ImportError as error:
        text = "checking a coordinate system needs pyproj: pip install 'mbf-flex[maps]'"
        raise MeshError("crs", [text]) from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # of the old form +init=epsg:25832
            return CRS.from_user_input(text)
    except CRSError as error:
        register = "the EPSG register has no such system" if text.startswith("EPSG:") else "PROJ knows no such system"
        raise MeshError("crs", [f"{register}, got {text!r:.60}"]) from error


def contradicts(stated: str, given: str) -> bool:
    """Whether two coordinate systems mean different places; not where one of them is unknown or has no projection.

    ``stated`` is a code or a name, as files state it; ``given`` is what ``given_system`` has accepted.
    """
    try:
        one, other = registered(stated), registered(given)
    except MeshError:
        return False
    if not stated.startswith("EPSG:") and one.name.casefold() != stated.casefold():
        return False  # a name that PROJ has only guessed
    pair = [system.sub_crs_list[0] if system.is_compound else system for system in (one, other)]
    first, second = (system.source_crs or system if system.is_bound else system for system in pair)
    if not (first.is_projected and second.is_projected) or first.ellipsoid is None or second.ellipsoid is None:
        return False
    axes = first.ellipsoid.semi_major_metre, second.ellipsoid.semi_major_metre
    return abs(axes[0] - axes[1]) > SAME_ELLIPSOID or not _same_projection(first, second)


def _same_projection(one: CRS, other: CRS) -> bool:
    first, second = one.coordinate_operation, other.coordinate_operation
    if first is None or second is None:
        return True
    pair = [{p.code: float(p.value) * p.unit_conversion_factor for p in each.params} for each in (first, second)]
    return (
        first.method_name == second.method_name
        and pair[0].keys() == pair[1].keys()
        and all(math.isclose(value, pair[1][code], rel_tol=1e-9, abs_tol=1e-9) for code, value in pair[0].items())
    )
