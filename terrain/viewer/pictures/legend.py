"""The legend of a run's colours, of those that occur in it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import ACTORS, DRIVEN, OBSTACLE, PLANNED, SCAN, Colour, slope_legend
from terrain.viewer.pictures.shading import FLAT_GROUND

Entry = tuple[str, Colour]

STYLE = "display:inline-flex;align-items:center;gap:4px;margin-right:10px"
BOX = "width:10px;height:10px;border-radius:2px;background:rgb({},{},{})"


def legend_of(recording: Recording) -> list[Entry]:
    """Names and colours of lines, points and things, then of slopes where the ground is not flat."""
    entries = [("plan", PLANNED), ("driven", DRIVEN)]
    if recording.scans:
        entries.append(("seen by a sensor", SCAN))
    if recording.obstacles is not None:
        entries.append(("on no map", OBSTACLE))
    entries += [(thing, ACTORS[thing]) for thing in sorted({track.thing for track in recording.actors})]
    ground = recording.ground
    if ground is not None and np.ptp(ground.vertices[:, 2]) >= FLAT_GROUND:
        entries += [(f"slope {angle}", colour) for angle, colour in slope_legend()]
    return entries


def legend_html(entries: Iterable[Entry]) -> str:
    """Return a line of small boxes, each with its name."""
    items = (
        f'<span style="{STYLE}"><span style="{BOX.format(*colour)}"></span><span>{name}</span></span>'
        for name, colour in entries
    )
    return "".join(items)
