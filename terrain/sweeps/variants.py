"""Names of the variants of a sweep as tables and figures show them: without what all of them share."""

from __future__ import annotations

import re
from collections.abc import Sequence

AS_WRITTEN = "as written"


def short_names(variants: Sequence[str]) -> dict[str, str]:
    """Return a name for each variant: its settings that are not those of all; all of them where there is one variant.

    >>> short_names(["backend=mesh planner=cvp", "backend=mesh planner=astar"])
    {'backend=mesh planner=cvp': 'planner=cvp', 'backend=mesh planner=astar': 'planner=astar'}
    """
    shared = common_settings(variants)
    return {
        variant: " ".join(one for one in settings_of(variant) if one not in shared) or AS_WRITTEN
        for variant in variants
    }


def common_settings(variants: Sequence[str]) -> list[str]:
    """Return the settings that all of several variants share, as ``KEY=VALUE``."""
    if len(variants) < 2:
        return []
    return [one for one in settings_of(variants[0]) if all(one in settings_of(other) for other in variants)]


def settings_of(variant: str) -> list[str]:
    """Return the settings of a variant; a value may hold spaces."""
    return re.split(r" (?=[^ =]+=)", variant) if variant else []
