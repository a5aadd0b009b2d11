"""Takes a scenario to another building: any map_server map, with a start and a goal that suit it.

Use it for ``mbf run indoor --map FILE``. Obstacles of the scenario stay behind, because they belong to its own floor.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label

from mbf_abstract.config.findings import ConfigError, Finding
from terrain.scenarios.scenario import MapWorld, PlanarPose, Scenario
from terrain.urdf_robots.robot_choice import spec_of
from terrain.worlds.occupancy import OccupancyGrid, read_occupancy

MARGIN = 0.15  # m kept free around the robot's outline
NEAR_ZERO = 1000.0  # m; farther away single precision is coarser than a tenth of a millimetre


def on_map(scenario: Scenario, file: Path) -> Scenario:
    """Return the scenario in the building of ``file``, from one end of its largest free region to the other.

    A map far from zero is moved to zero, because the physics calculates in single precision.

    Raises
    ------
    ConfigError
        The file is no map, there is no room for the robot in it, or the scenario has several robots.
    """
    if scenario.robots:
        raise ConfigError([Finding(scenario.name, 1, "robots", "a scenario with one robot for another map", "several")])
    world = MapWorld(type="map", file=file.resolve())
    corner = read_occupancy(file)
    if max(abs(corner.origin_x), abs(corner.origin_y)) > NEAR_ZERO:
        world = world.model_copy(update={"corner": (0.0, 0.0)})
    grid = world.grid()
    radius = spec_of(scenario.robot).circumscribed_radius + MARGIN
    ends = far_apart_places(grid, radius)
    if ends is None:
        finding = Finding(str(file), 1, "", f"free space for a robot of radius {radius:.2f} m", "none")
        raise ConfigError([finding])
    start, goal = ends
    changes = {"world": world, "start": start, "goals": (goal,), "obstacles": (), "name": file.stem}
    return scenario.model_copy(update=changes)


def far_apart_places(grid: OccupancyGrid, radius: float) -> tuple[PlanarPose, PlanarPose] | None:
    """Two places in the same region of cells with ``radius`` [m] of known free space around, far from each other.

    The first is the one farthest from the region's middle, the second the one farthest from the first, both in a
    straight line; None if there is no such region of two cells.
    """
    clearance = distance_transform_edt(np.pad(grid.free, 1))[1:-1, 1:-1] * grid.resolution
    regions, count = label(clearance > radius)
    if count == 0:
        return None
    sizes = np.bincount(regions.ravel())
    sizes[0] = 0
    cells = np.argwhere(regions == sizes.argmax()).astype(np.float64)
    if len(cells) < 2:
        return None
    first = _farthest(cells, cells.mean(axis=0))
    second = _farthest(cells, first)
    yaw = math.atan2(*(second - first).tolist())
    return _place(grid, first, yaw), _place(grid, second, yaw)


def _farthest(cells: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(cells[np.argmax(np.sum((cells - point) ** 2, axis=1))])


def _place(grid: OccupancyGrid, cell: NDArray[np.float64], yaw: float) -> PlanarPose:
    iy, ix = cell.tolist()
    x, y = grid.origin_x + (ix + 0.5) * grid.resolution, grid.origin_y + (iy + 0.5) * grid.resolution
    return PlanarPose(x=x, y=y, yaw=yaw)
