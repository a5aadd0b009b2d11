"""Where the map of a file lies in the coordinates of its survey, if the file states it.

The header of a map of ``mbf map build`` does. For elevation models, a package that reads one offers a function by an
entry point of the group ``mbf.elevation_surveys``, named by the ending without its dot: ``survey_of(path)`` returns a
``Survey`` whose origin is the south-western sample, or None. It reads no heights.
"""

from __future__ import annotations

import math
from pathlib import Path

from mbf_abstract.config.installed_plugins import installed_points
from mbf_abstract.geometry.survey import Survey
from mbf_mesh_nav.files.map_header import read_map_header

SURVEYS_GROUP = "mbf.elevation_surveys"


def survey_of(file: str) -> Survey | None:
    """Survey of a map file that can be read; None where it states none, and for "" (arrays)."""
    if not file:
        return None
    for point in installed_points(SURVEYS_GROUP):
        if Path(file).suffix.lower() == f".{point.name}":
            survey: Survey | None = point.load()(Path(file))
            is_usable = survey is not None and all(map(math.isfinite, (*survey.origin, *survey.units)))
            return survey if is_usable else None
    header = read_map_header(Path(file))
    return None if header is None else Survey(header.origin, crs=header.crs)
