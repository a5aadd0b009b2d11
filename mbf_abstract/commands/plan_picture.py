"""The picture of ``mbf plan --png``, drawn by whatever installed package can draw.

The core must not plot. A package that can offers a function by an entry point of the group ``mbf.plan_pictures``:
``write(file, view, start, goal, path, title)``, see ``mbf_abstract.maps.view`` for the view.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from pathlib import Path

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.result_types import GetPathResult
from mbf_abstract.server.navigation_server import AbstractNavigationServer

PICTURES_GROUP = "mbf.plan_pictures"


class NoPainter(Exception):
    """No installed package draws pictures of plans."""


def draw_plan(file: Path, server: AbstractNavigationServer, start: Pose, goal: Pose, result: GetPathResult) -> None:
    """Draw map, start, goal and path; raises NoPainter, or what the painter raises."""
    painters = sorted(entry_points(group=PICTURES_GROUP), key=lambda point: point.name)
    if not painters:
        raise NoPainter("no installed package draws pictures; install the extra: pip install 'mbf-flex[sim]'")
    title = f"{result.planner or 'no planner'} · {result.outcome_name}"
    painters[0].load()(file, server.map_view(), start, goal, result.path, title)
