"""Generated worlds of several levels: a parking garage with ramps, and a bridge over a road.

Only a planner on a mesh finds paths in them: a 2D map shows floor and roof, deck and road at the same place. The
``ground`` is what wheels may roll on and what a mesh server plans on; ``walls`` block wheels and sensors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from terrain.physics.world import BulletWorld
from terrain.worlds.surface import Surface, box_between, height_grid, joined, merged

CELL = 0.5  # m; edge length of all cells
WALL = 0.1  # m; thickness of parapets
PARAPET = 1.0  # m; height of parapets

GARAGE_LENGTH, GARAGE_WIDTH = 36.0, 24.0
STOREY = 2.8
RAMP_START, RAMP_END, RAMP_WIDTH = 8.0, 28.0, 5.0  # 2.8 m in 20 m: 8 degrees
PILLARS = tuple((x, y) for x in (6.0, 12.0, 18.0, 24.0, 30.0) for y in (9.0, 15.0))
BOX_HEIGHT = 1.5  # m
PARKED = tuple((x, y) for x in (9.5, 14.5, 20.5, 26.5) for y in (9.5, 12.0))  # south-west corners of 2 x 2 m boxes

BRIDGE_LENGTH, BRIDGE_WIDTH, DECK = 44.0, 24.0, 2.5
ABUTMENT_WEST, ABUTMENT_EAST, RAMP_FOOT = 17.0, 27.0, 3.0  # x; the road passes between the abutments
LANE_SOUTH, LANE_NORTH, BANK = 10.0, 14.0, 3.0


@dataclass(frozen=True, eq=False)
class MultiLevelWorld:
    """A world of several levels.

    Attributes
    ----------
    places : mapping of str to Pose
        Named poses on the ground.
    """

    ground: Surface
    walls: Surface
    places: Mapping[str, Pose]

    def add_to(self, world: BulletWorld) -> None:
        """Put ground and walls, if there are any, into a PyBullet world."""
        world.add_mesh(*self.ground)
        if len(self.walls.faces):
            world.add_mesh(*self.walls, ground=False)


def parking_garage(levels: int = 4) -> MultiLevelWorld:
    """A garage of 36 x 24 m: ramps alternate between the south and the north side, the last level is the roof.

    Places: ``entrance`` on the ground floor, ``level_1`` ..., and ``roof``.

    Raises
    ------
    ValueError
        Fewer than two levels.
    """
    if levels < 2:
        raise ValueError(f"a garage needs at least 2 levels, got {levels}")
    x, y = _lines(0.0, GARAGE_LENGTH), _lines(0.0, GARAGE_WIDTH)
    ground = [_garage_floor(x, y, level, levels) for level in range(levels)]
    ground += [_ramp(level) for level in range(levels - 1)]
    walls = _outer_walls(GARAGE_LENGTH, GARAGE_WIDTH, (levels - 1) * STOREY + PARAPET)
    for level in range(levels - 1):
        walls += _ramp_parapets(level)
    for level in range(levels):
        walls += _garage_furniture(level, levels)
    names = ["entrance", *(f"level_{level}" for level in range(1, levels - 1)), "roof"]
    places = {name: Pose.planar(3.0, 12.0, 0.0, level * STOREY) for level, name in enumerate(names)}
    return MultiLevelWorld(merged(ground), joined(walls), places)


def _lines(start: float, end: float) -> FloatArray:
    return np.linspace(start, end, round((end - start) / CELL) + 1)


def _ramp_lane(level: int) -> tuple[float, float]:
    """South and north edge [m] of the ramp that leaves ``level`` upwards."""
    return (0.0, RAMP_WIDTH) if level % 2 == 0 else (GARAGE_WIDTH - RAMP_WIDTH, GARAGE_WIDTH)


def _cells(
    x: FloatArray, y: FloatArray, x_range: tuple[float, float], y_range: tuple[float, float]
) -> NDArray[np.bool_]:
    """Mark the cells (ny - 1, nx - 1) whose middle lies in a rectangle [m]."""
    middle_x, middle_y = 0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])
    in_x = (middle_x > x_range[0]) & (middle_x < x_range[1])
    in_y = (middle_y > y_range[0]) & (middle_y < y_range[1])
    return np.asarray(in_y[:, None] & in_x[None, :])


def _garage_floor(x: FloatArray, y: FloatArray, level: int, levels: int) -> Surface:
    """One floor; open where the ramp from below arrives and where the ramp upwards begins, and under pillars."""
    keep = np.ones((len(y) - 1, len(x) - 1), dtype=bool)
    ramps = [ramp for ramp in (level - 1, level) if 0 <= ramp < levels - 1]
    for ramp in ramps:
        keep &= ~_cells(x, y, (RAMP_START, RAMP_END), _ramp_lane(ramp))
    for low, high in _furniture_footprints(level, levels):
        keep &= ~_cells(x, y, (low[0], high[0]), (low[1], high[1]))
    return height_grid(x, y, np.full((len(y), len(x)), level * STOREY), keep)


def _ramp(level: int) -> Surface:
    x, y = _lines(RAMP_START, RAMP_END), _lines(*_ramp_lane(level))
    rise = STOREY * (x - RAMP_START) / (RAMP_END - RAMP_START)
    return height_grid(x, y, np.tile(level * STOREY + rise, (len(y), 1)))


def _ramp_parapets(level: int) -> list[Surface]:
    """Walls inside the ramp's lane: beside it on both floors, below its upper end, above its lower end."""
    south, north = _ramp_lane(level)
    floor, above = level * STOREY, (level + 1) * STOREY
    inner = (north - WALL, north) if level % 2 == 0 else (south, south + WALL)
    beside = [box_between((RAMP_START, inner[0], z), (RAMP_END, inner[1], z + PARAPET)) for z in (floor, above)]
    below = box_between((RAMP_END - WALL, south, floor), (RAMP_END, north, floor + PARAPET))
    over = box_between((RAMP_START, south, above), (RAMP_START + WALL, north, above + PARAPET))
    return [*beside, below, over]


def _furniture_footprints(level: int, levels: int) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """South-west and north-east corners [m] of pillars (not on the roof) and of every other parked box."""
    footprints = [((x, y), (x + CELL, y + CELL)) for x, y in PILLARS if level < levels - 1]
    return footprints + [((x, y), (x + 2.0, y + 2.0)) for x, y in PARKED[level % 2 :: 2]]


def _garage_furniture(level: int, levels: int) -> list[Surface]:
    """Pillars that end just below the next floor, so that its traffic does not touch them, and parked boxes."""
    floor = level * STOREY
    boxes = []
    for low, high in _furniture_footprints(level, levels):
        height = STOREY - WALL if high[0] - low[0] == CELL else BOX_HEIGHT
        boxes.append(box_between((*low, floor), (*high, floor + height)))
    return boxes


def _outer_walls(length: float, width: float, height: float) -> list[Surface]:
    return [
        box_between((-WALL, -WALL, 0.0), (length + WALL, 0.0, height)),
        box_between((-WALL, width, 0.0), (length + WALL, width + WALL, height)),
        box_between((-WALL, 0.0, 0.0), (0.0, width, height)),
        box_between((length, 0.0, 0.0), (length + WALL, width, height)),
    ]


def bridge_over_road() -> MultiLevelWorld:
    """Two embankments and a deck 2.5 m above the ground; a road passes below it, from south to north.

    Places: ``west`` and ``east`` at the feet of the ramps, ``deck`` in the middle above, ``road`` below it, ``south``
    and ``north`` on the road.
    """
    x, y = _lines(0.0, BRIDGE_LENGTH), _lines(0.0, BRIDGE_WIDTH)
    west = np.clip((x - RAMP_FOOT) / (ABUTMENT_WEST - RAMP_FOOT), 0.0, 1.0) * (x <= ABUTMENT_WEST)
    east = np.clip((BRIDGE_LENGTH - RAMP_FOOT - x) / (BRIDGE_LENGTH - RAMP_FOOT - ABUTMENT_EAST), 0.0, 1.0)
    east *= x >= ABUTMENT_EAST
    across = np.clip(1.0 - np.maximum(LANE_SOUTH - y, y - LANE_NORTH) / BANK, 0.0, 1.0)
    keep = np.ones((len(y) - 1, len(x) - 1), dtype=bool)
    lane = (LANE_SOUTH, LANE_NORTH)
    for abutment in ((ABUTMENT_WEST, ABUTMENT_WEST + CELL), (ABUTMENT_EAST - CELL, ABUTMENT_EAST)):
        keep &= ~_cells(x, y, abutment, lane)
    terrain = height_grid(x, y, DECK * (west + east) * across[:, None], keep)
    deck_x, deck_y = _lines(ABUTMENT_WEST, ABUTMENT_EAST), _lines(*lane)
    deck = height_grid(deck_x, deck_y, np.full((len(deck_y), len(deck_x)), DECK))
    return MultiLevelWorld(merged([terrain, deck]), joined(_bridge_walls()), _bridge_places())


def _bridge_walls() -> list[Surface]:
    """Abutments up to just below the deck, parapets beside it on its outside, and a wall around the world."""
    walls = _outer_walls(BRIDGE_LENGTH, BRIDGE_WIDTH, PARAPET)
    for start in (ABUTMENT_WEST, ABUTMENT_EAST - CELL):
        walls.append(box_between((start, LANE_SOUTH, 0.0), (start + CELL, LANE_NORTH, DECK - WALL)))
    for start in (LANE_SOUTH - WALL, LANE_NORTH):
        walls.append(box_between((ABUTMENT_WEST, start, DECK - WALL), (ABUTMENT_EAST, start + WALL, DECK + PARAPET)))
    return walls


def _bridge_places() -> dict[str, Pose]:
    middle_x, middle_y = 0.5 * (ABUTMENT_WEST + ABUTMENT_EAST), 0.5 * (LANE_SOUTH + LANE_NORTH)
    return {
        "west": Pose.planar(1.5, middle_y),
        "east": Pose.planar(BRIDGE_LENGTH - 1.5, middle_y),
        "deck": Pose.planar(middle_x, middle_y, 0.0, DECK),
        "road": Pose.planar(middle_x, middle_y, 0.5 * np.pi),
        "south": Pose.planar(middle_x, 2.0, 0.5 * np.pi),
        "north": Pose.planar(middle_x, BRIDGE_WIDTH - 2.0, 0.5 * np.pi),
    }
