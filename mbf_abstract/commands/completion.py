"""What a shell offers for the values of options when the tab key is pressed; see ``mbf --install-completion``.

It has to come at once, so nothing is imported here that takes time, and no plugin.
"""

from __future__ import annotations

from collections.abc import Iterable

from mbf_abstract.config.installed_plugins import points_of


def starting_with(incomplete: str, values: Iterable[str]) -> list[str]:
    """Return the values that begin with what was typed, sorted."""
    return sorted(value for value in set(values) if value.startswith(incomplete))


def _types_of(group: str, incomplete: str) -> list[str]:
    """Types of a group of plugins: short names, and full ones once their map is typed."""
    names = points_of(group)
    return starting_with(incomplete, names if "." in incomplete else (name.split(".")[-1] for name in names))


def complete_planner(incomplete: str) -> list[str]:
    """Types of planners."""
    return _types_of("planners", incomplete)


def complete_controller(incomplete: str) -> list[str]:
    """Types of controllers."""
    return _types_of("controllers", incomplete)


def complete_backend(incomplete: str) -> list[str]:
    """Names of the installed servers."""
    return starting_with(incomplete, points_of("servers"))
