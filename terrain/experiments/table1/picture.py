"""A picture of the world: racks, routes of the other robots, waypoints, and our robot's tracks in each condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from terrain.experiments.table1.environments.world import Table1World

TITLES = {"S1": "move_base (S1)", "B": "tree (B)"}
DOTS_PER_INCH = 90
ROBOTS = 5  # whose routes are driven in the main conditions


def draw_tracks(
    file: Path, world: Table1World | None, tracks: Mapping[str, Sequence[Sequence[Sequence[float]]]]
) -> None:
    """Write a PNG with one map for each condition.

    Parameters
    ----------
    world : Table1World or None
        Nothing but the tracks is drawn without it.
    tracks : mapping of str to list of (n, 2) lists
        Tracks [m] of every repetition of each condition.
    """
    figure, axes = plt.subplots(1, len(tracks), figsize=(6.2 * len(tracks), 6.4), squeeze=False)
    for axis, (name, of_condition) in zip(axes[0], tracks.items(), strict=True):
        if world is not None:
            _draw_world(axis, world)
        axis.set_aspect("equal")
        axis.set_xlabel("x [m]")
        axis.set_ylabel("y [m]")
        for track in of_condition:
            axis.plot(*np.transpose(track), color="tab:blue", linewidth=0.6, alpha=0.6)
        axis.set_title(f"{TITLES.get(name, name)}: {len(of_condition)} repetitions", parse_math=False)
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=DOTS_PER_INCH)
    plt.close(figure)


def _draw_world(axis: Any, world: Table1World) -> None:
    grid = world.grid()
    axis.imshow(~grid.occupied, origin="lower", extent=grid.bounds, cmap="gray", vmin=-1.0, vmax=1.0)
    for route in world.routes[:ROBOTS]:
        corners = np.array([*route, route[0]])
        axis.plot(*corners.T, color="tab:orange", linewidth=3.0, alpha=0.25)
    for number, (x, y, _) in enumerate(world.waypoints, start=1):
        axis.plot(x, y, "o", color="tab:red", markersize=9)
        axis.annotate(str(number), (x, y), color="white", ha="center", va="center", fontsize=7)
