"""The plugins that installed packages offer by entry points, without importing any of them.

``mbf plugins`` lists from here at once; ``registry`` imports the classes. Nothing is imported here that takes time.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points

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


def points_of(group: str) -> dict[str, list[EntryPoint]]:
    """Return the entry points of one of ``GROUPS`` by name; more than one of a name is a clash."""
    points: dict[str, list[EntryPoint]] = {}
    for point in entry_points(group=f"mbf.{group}"):
        points.setdefault(point.name, []).append(point)
    return points


def entry_of(group: str, points: list[EntryPoint], error: str | None = None) -> PluginEntry:
    """Describe the plugin of entry points that have one name."""
    return PluginEntry(points[0].name, group, points[0].value, ", ".join(origin_of(point) for point in points), error)


def origin_of(point: EntryPoint) -> str:
    """Return distribution and version of an entry point."""
    return f"{point.dist.name} {point.dist.version}" if point.dist is not None else "unknown distribution"


def is_ours(points: list[EntryPoint]) -> bool:
    """Whether this package alone offers what has these entry points of one name."""
    return all(point.dist is not None and point.dist.name == DISTRIBUTION for point in points) and len(points) == 1
