"""The plugins that installed packages offer by entry points, without importing any of them.

``mbf plugins`` lists from here at once; ``registry`` imports the classes. Nothing is imported here that takes time.
Entry points are read once for each state of the Python path: reading those of 200 packages takes 5 ms, and one command
asks for ten groups.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import Distribution, EntryPoint, entry_points

DISTRIBUTION = "mbf-flex"
GROUPS = ("planners", "controllers", "recoveries", "refiners", "costmap_layers", "mesh_layers", "servers")


@dataclass(frozen=True)
class PluginEntry:
    """One known plugin type, for listings.

    Attributes
    ----------
    name : str
        Full name, e.g. ``mesh.cvp``.
    group : str
        One of ``GROUPS``.
    target : str
        ``module:Class``.
    origin : str
        Distribution and version it comes from, or ``registered`` for a direct registration.
    error : str or None
        Why it cannot be used; None also where nobody has tried.
    """

    name: str
    group: str
    target: str
    origin: str
    error: str | None


def installed_points(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group, by its full name; what was installed meanwhile is seen."""
    return tuple(_all_points(tuple(_changes_of_path())).select(group=group))  # type: ignore[attr-defined]


def _changes_of_path() -> Iterator[tuple[str, int]]:
    """Yield each folder of the Python path with the time of its last change [ns], as an installation is one."""
    for entry in sys.path:
        try:
            yield entry, os.stat(entry or ".").st_mtime_ns
        except OSError:
            yield entry, 0


@lru_cache(maxsize=1)
def _all_points(changes: tuple[tuple[str, int], ...]) -> object:
    """Read the entry points of all groups; other ``changes`` make it read them anew."""
    return entry_points()


def points_of(group: str) -> dict[str, list[EntryPoint]]:
    """Return the entry points of one of ``GROUPS`` by name; more than one of a name is a clash."""
    points: dict[str, list[EntryPoint]] = {}
    for point in installed_points(f"mbf.{group}"):
        points.setdefault(point.name, []).append(point)
    return points


def entry_of(group: str, points: list[EntryPoint], error: str | None = None) -> PluginEntry:
    """Describe the plugin of entry points that have one name."""
    return PluginEntry(points[0].name, group, points[0].value, ", ".join(origin_of(point) for point in points), error)


def origin_of(point: EntryPoint) -> str:
    """Return distribution and version of an entry point."""
    return "unknown distribution" if point.dist is None else " ".join(_name_and_version(point.dist))


def is_ours(points: list[EntryPoint]) -> bool:
    """Whether this package alone offers what has these entry points of one name."""
    return (
        all(point.dist is not None and _name_and_version(point.dist)[0] == DISTRIBUTION for point in points)
        and len(points) == 1
    )


@lru_cache(maxsize=256)
def _name_and_version(distribution: Distribution) -> tuple[str, str]:
    """Read the metadata of a distribution once: it parses its whole file, readme included, for each of both."""
    metadata = distribution.metadata
    return metadata["Name"], metadata["Version"]
