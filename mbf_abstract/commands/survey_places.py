"""Places in coordinates of the survey of a map, as ``mbf plan --survey`` takes them; others are refused."""

from __future__ import annotations

from pathlib import Path

from mbf_abstract.commands.coordinates import Place
from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.survey import Survey
from mbf_abstract.server.navigation_server import AbstractNavigationServer

FARTHEST = 300_000.0
"""A place so far [m] from where a map begins is not on it, but meant in other coordinates."""
DEGREES = 1000.0
"""A survey whose unit is longer [m] is in degrees."""


def survey_of(server: AbstractNavigationServer, config: Path) -> Survey:
    """Return the survey of the map of a server; raises ConfigError about ``config`` where there is none."""
    if server.survey is None:
        expected = "a map whose file states its survey (GeoTIFF, ESRI ASCII, SRTM, a map of mbf map build)"
        raise ConfigError([Finding(str(config), 1, "", expected, "--survey with another one")])
    return server.survey


def refuse_elsewhere(survey: Survey, config: Path, **places: Place) -> None:
    """Raise ConfigError about each of the named places that is in other coordinates than those of the survey."""
    findings = []
    for name, place in places.items():
        if float(norm(survey.to_map(place.x, place.y))) > FARTHEST:
            x, y, _ = survey.origin
            expected = f"--{name} near ({x:.10g}, {y:.10g}), where the map begins in its survey ({survey.crs or '?'})"
            got = f"({place.x:.10g}, {place.y:.10g})"
            findings.append(Finding(str(config), 1, "", expected, got, _hint(survey, place)))
    if findings:
        raise ConfigError(findings)


def _hint(survey: Survey, place: Place) -> str:
    """What may be meant by a place that is far from the map."""
    in_degrees = abs(place.x) <= 180.0 and abs(place.y) <= 90.0
    swapped = float(norm(survey.to_map(place.y, place.x))) <= FARTHEST
    if survey.units[1] > DEGREES:
        return "longitude comes before latitude" if swapped else "this map takes degrees: LON LAT"
    if swapped:
        return "easting comes before northing"
    if not in_degrees:
        return ""
    hint = "degrees have to be transformed into the coordinates of the survey"
    if not survey.crs:
        return hint
    call = f"Transformer.from_crs(4326, {survey.crs!r}, always_xy=True).transform({place.x:.10g}, {place.y:.10g})"
    return f'{hint}; with pip install pyproj: python -c "from pyproj import Transformer; print({call})"'
