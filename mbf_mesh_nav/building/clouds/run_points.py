"""Folders of runs as point clouds: what the robot's own range sensors hit.

This package knows no recordings. One that does offers a function by an entry point of the group ``mbf.run_points``:
``read(folder, max_points)`` returns the hits (n, 3) [m], z up, in the run's map frame. It refuses a folder that holds
no run, or more than ``max_points`` hits. Whatever it raises becomes a ``MeshError``.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from pathlib import Path

import numpy as np

from mbf_mesh_nav.building.clouds.stored_points import StoredPoints
from mbf_mesh_nav.mesh.mesh_report import MeshError

READERS_GROUP = "mbf.run_points"


def read_run_points(folder: Path, max_points: int) -> StoredPoints:
    """Read the hits of a run.

    Raises
    ------
    MeshError
        No installed package reads runs, or the folder holds none with hits.
    """
    readers = sorted(entry_points(group=READERS_GROUP), key=lambda point: point.name)
    if not readers:
        raise MeshError(str(folder), ["no installed package reads recordings of runs"])
    try:
        points = np.asarray(readers[0].load()(folder, max_points), dtype=np.float64).reshape(-1, 3)
    except Exception as error:  # whatever the reader of another package raises
        reason = str(error).removeprefix(f"{folder}: ")
        raise MeshError(str(folder), [f"cannot be read as a run: {reason}"]) from error
    return StoredPoints(points)
