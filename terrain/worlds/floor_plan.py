"""Draw a map from a short floor plan: rooms as rectangles of walls, doors as gaps, furniture.

``OFFICE_MAP`` is the floor that ships with the package; after a change of ``data/office.plan.yaml`` its files are made
anew by ``write_map(read_floor_plan().draw(), DATA_FOLDER, "office")``. For real buildings read their map with
``terrain.worlds.occupancy.read_occupancy``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from terrain.worlds.occupancy import OccupancyGrid, write_map_files

BoolArray = NDArray[np.bool_]

DATA_FOLDER = Path(__file__).resolve().parents[1] / "data"
OFFICE_PLAN = DATA_FOLDER / "office.plan.yaml"
OFFICE_MAP = DATA_FOLDER / "office.yaml"
RESOLUTION = 0.05
MIN_DOOR_WIDTH = 0.9

PIXEL_OCCUPIED, PIXEL_UNKNOWN, PIXEL_FREE = 0, 205, 254


class FloorPlanError(Exception):
    """A floor plan cannot be drawn; the text names the part and the reason."""


@dataclass(frozen=True)
class Rectangle:
    """Axis-parallel rectangle [m]."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float


@dataclass(frozen=True)
class FloorPlan:
    """A floor in metres.

    Attributes
    ----------
    size : (float, float)
        Extent of the map along x and y.
    walls, doors, furniture : tuple of Rectangle
        Doors are cut out of walls; furniture is put in last.
    pillars : tuple of (x, y, radius)
    places : dict of str to (x, y, yaw)
        Free places with a name.
    """

    size: tuple[float, float]
    walls: tuple[Rectangle, ...]
    doors: tuple[Rectangle, ...]
    furniture: tuple[Rectangle, ...]
    pillars: tuple[tuple[float, float, float], ...]
    places: dict[str, tuple[float, float, float]]

    def draw(self, resolution: float = RESOLUTION) -> OccupancyGrid:
        """Draw the plan into cells of ``resolution`` [m]; a cell is occupied if its centre is. Outside is unknown."""
        nx, ny = (round(length / resolution) for length in self.size)
        x, y = np.meshgrid((np.arange(nx) + 0.5) * resolution, (np.arange(ny) + 0.5) * resolution)
        walls = _inside_any(x, y, self.walls) & ~_inside_any(x, y, self.doors)
        occupied = walls | _inside_any(x, y, self.furniture)
        for centre_x, centre_y, radius in self.pillars:
            occupied |= np.hypot(x - centre_x, y - centre_y) <= radius
        outline = Rectangle(
            min(wall.x_min for wall in self.walls),
            min(wall.y_min for wall in self.walls),
            max(wall.x_max for wall in self.walls),
            max(wall.y_max for wall in self.walls),
        )
        return OccupancyGrid(occupied, _inside_any(x, y, (outline,)) & ~occupied, resolution)


def _inside_any(x: NDArray[np.float64], y: NDArray[np.float64], rectangles: tuple[Rectangle, ...]) -> BoolArray:
    inside = np.zeros(x.shape, dtype=bool)
    for r in rectangles:
        inside |= (x >= r.x_min) & (x <= r.x_max) & (y >= r.y_min) & (y <= r.y_max)
    return inside


def read_floor_plan(path: str | Path = OFFICE_PLAN) -> FloorPlan:
    """Read a floor plan; the format is explained in ``data/office.plan.yaml``.

    Raises
    ------
    FloorPlanError
        A missing key, a door off its wall or narrower than 0.9 m.
    """
    document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    try:
        half = 0.5 * float(document["wall_thickness"])
        walls: list[Rectangle] = []
        doors: list[Rectangle] = []
        for room in document["rooms"]:
            sides = _sides(room, half)
            walls += sides.values()
            doors += [_door(room, door, sides, half) for door in room.get("doors", ())]
        return FloorPlan(
            size=(float(document["size"][0]), float(document["size"][1])),
            walls=tuple(walls),
            doors=tuple(doors),
            furniture=tuple(Rectangle(*box["from"], *box["to"]) for box in document.get("boxes", ())),
            pillars=tuple((*pillar["at"], pillar["radius"]) for pillar in document.get("pillars", ())),
            places={name: tuple(place) for name, place in document.get("places", {}).items()},
        )
    except KeyError as error:
        raise FloorPlanError(f"{path}: expected the key {error}, got none") from error
    except (TypeError, ValueError) as error:
        raise FloorPlanError(f"{path}: {error}") from error


def _sides(room: dict[str, Any], half: float) -> dict[str, Rectangle]:
    (x_min, y_min), (x_max, y_max) = room["from"], room["to"]
    return {
        "south": Rectangle(x_min - half, y_min - half, x_max + half, y_min + half),
        "north": Rectangle(x_min - half, y_max - half, x_max + half, y_max + half),
        "west": Rectangle(x_min - half, y_min - half, x_min + half, y_max + half),
        "east": Rectangle(x_max - half, y_min - half, x_max + half, y_max + half),
    }


def _door(room: dict[str, Any], door: dict[str, Any], sides: dict[str, Rectangle], half: float) -> Rectangle:
    """Return the gap that a door cuts into its wall."""
    wall, at, width = sides[door["side"]], float(door["at"]), float(door["width"])
    along_x = door["side"] in ("south", "north")
    length = (wall.x_max - wall.x_min if along_x else wall.y_max - wall.y_min) - 2.0 * half
    if width < MIN_DOOR_WIDTH:
        raise FloorPlanError(f"a door of {room['name']} is {width} m wide, at least {MIN_DOOR_WIDTH} m are needed")
    if not 0.5 * width <= at <= length - 0.5 * width:
        raise FloorPlanError(f"a door of {room['name']} at {at} m does not fit into its wall of {length} m")
    if along_x:
        middle = wall.x_min + half + at
        return Rectangle(middle - 0.5 * width, wall.y_min, middle + 0.5 * width, wall.y_max)
    middle = wall.y_min + half + at
    return Rectangle(wall.x_min, middle - 0.5 * width, wall.x_max, middle + 0.5 * width)


def write_map(grid: OccupancyGrid, folder: str | Path, name: str) -> Path:
    """Write map_server files ``name.yaml`` and ``name.png`` into ``folder``; return the yaml's path."""
    pixels = np.full(grid.occupied.shape, PIXEL_UNKNOWN, dtype=np.uint8)
    pixels[grid.free] = PIXEL_FREE
    pixels[grid.occupied] = PIXEL_OCCUPIED
    return write_map_files(Path(folder) / name, pixels, grid)
