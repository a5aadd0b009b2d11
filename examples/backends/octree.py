"""An octree of occupancy, as OctoMap has: the map of the backend ``occupancy_octree``.

When to use: maps in which the height of things matters and most of space is empty or solid. When not: large maps at
full rate, it is plain Python.
Source: Hornung et al., "OctoMap", 2013: clamped log-odds, eight equal cubes become one.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray

Cube = tuple[int, int, int]
Column = tuple[int, int]
HIT, MISS, LOWEST, HIGHEST = 0.85, -0.4, -2.0, 3.5  # log-odds, the values of the paper
LEVELS = 8
CORNERS = list(itertools.product((0, 1), repeat=3))


class Octree:
    """Log-odds of occupancy by level: a cube of level k has the edge of 2^k smallest ones; unknown ones are absent."""

    def __init__(self, resolution: float) -> None:
        self.resolution = resolution  # m, the edge of a smallest cube
        self.levels: list[dict[Cube, float]] = [{} for _ in range(LEVELS)]

    def log_odds(self, cube: Cube) -> float | None:
        """Value of a smallest cube, None if it was never seen."""
        found = (cubes.get(_above(cube, level)) for level, cubes in enumerate(self.levels) if cubes)
        return next((value for value in found if value is not None), None)

    def insert(self, origin: FloatArray, ends: FloatArray, hits: NDArray[np.bool_]) -> None:
        """Mark where rays from (3,) to (n, 3) [m] hit something (n,), and clear what they went through."""
        lengths = np.linalg.norm(ends - origin, axis=1, keepdims=True)
        parts = np.arange(0.0, lengths.max(initial=0.0), self.resolution / 2.0) / np.maximum(lengths, 1e-9)
        through = (origin + parts[..., None] * (ends - origin)[:, None])[parts < 1.0]
        occupied = self._cubes(ends[hits])
        for cubes, change in ((self._cubes(through) - occupied, MISS), (occupied, HIT)):
            for cube in cubes:
                self.update(cube, change)

    def _cubes(self, points: FloatArray) -> set[Cube]:
        """The smallest cubes that hold points (n, 3) [m]."""
        cubes = np.unique(np.floor(points / self.resolution).astype(int), axis=0)
        return {(x, y, z) for x, y, z in cubes.tolist()}

    def update(self, cube: Cube, change: float) -> None:
        """Add evidence to a smallest cube; eight that have become equally certain are merged."""
        old = self.log_odds(cube)
        new = min(max((old or 0.0) + change, LOWEST), HIGHEST)
        if new == old:
            return
        if old is not None and cube not in self.levels[0]:
            self._split(cube)
        self.levels[0][cube] = new
        if new in (LOWEST, HIGHEST):
            self._merge(cube)

    def _split(self, cube: Cube) -> None:
        """Break the large cube that holds a smallest one."""
        for level in range(LEVELS - 1, 0, -1):
            value = self.levels[level].pop(_above(cube, level), None)
            if value is not None:
                self.levels[level - 1].update(dict.fromkeys(_children(_above(cube, level)), value))

    def _merge(self, cube: Cube) -> None:
        """Make one cube of eight equal ones, as far up as it goes."""
        for level in range(LEVELS - 1):
            parent, cubes = _above(cube, level + 1), self.levels[level]
            children = _children(parent)
            value = cubes[children[0]] if children[0] in cubes else None
            if value is None or any(cubes.get(child) != value for child in children):
                return
            for child in children:
                del cubes[child]
            self.levels[level + 1][parent] = value

    def forget(self, center: tuple[float, float], half: float, inside: bool) -> None:
        """Forget the cubes inside, or outside, a square of side 2 ``half`` [m] as seen from above.

        Large cubes across its sides are split, smallest ones kept.
        """
        for level in range(LEVELS - 1, -1, -1):
            edge = self.resolution * (1 << level)
            for cube, value in list(self.levels[level].items()):
                gaps = [abs((cube[axis] + 0.5) * edge - center[axis]) for axis in (0, 1)]
                within, beyond = max(gaps) + 0.5 * edge <= half, max(gaps) - 0.5 * edge >= half
                if within or beyond:
                    if within == inside:
                        del self.levels[level][cube]
                elif level > 0:
                    del self.levels[level][cube]
                    self.levels[level - 1].update(dict.fromkeys(_children(cube), value))

    def columns(self, z_min: float, z_max: float, occupied: bool) -> set[Column]:
        """Columns (x, y) of smallest cubes with an occupied (or: a known) one between two heights [m]."""
        z_low, z_high = math.floor(z_min / self.resolution), math.ceil(z_max / self.resolution) - 1
        found = set()
        for level, cubes in enumerate(self.levels):
            for (x, y, z), value in cubes.items():
                if (value > 0.0 or not occupied) and z << level <= z_high and (z + 1) << level > z_low:
                    wide = range(1 << level)
                    found |= {((x << level) + dx, (y << level) + dy) for dx in wide for dy in wide}
        return found


def _above(cube: Cube, level: int) -> Cube:
    return cube[0] >> level, cube[1] >> level, cube[2] >> level


def _children(parent: Cube) -> list[Cube]:
    x, y, z = parent
    return [(2 * x + dx, 2 * y + dy, 2 * z + dz) for dx, dy, dz in CORNERS]
