"""What sensors have raised on a map of tiles, laid over the stored values in memory only.

Sensed obstacles only ever add costs, so what the portals hold as least costs stays least.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray
from mbf_mesh_nav.tiles.index import Box


@dataclass(frozen=True, eq=False)
class SensedCosts:
    """Vertices whose values are worse than the stored ones.

    Attributes
    ----------
    numbers : (k,) int64
        Numbers of the vertices in the whole map, ascending.
    costs, lethal : (k,) float32, bool
    places : (k, 3) float64
        [m]
    box : Box
        Around them [m].
    """

    numbers: NDArray[np.int64]
    costs: Float32Array
    lethal: BoolArray
    places: FloatArray
    box: Box

    @classmethod
    def at(cls, numbers: NDArray[np.int64], costs: Float32Array, lethal: BoolArray, places: FloatArray) -> SensedCosts:
        """Values (k,) of vertices in any order, by their numbers (k,) and places (k, 3) [m]."""
        if not len(numbers):
            return NOTHING_SENSED
        order = np.argsort(numbers, kind="stable")
        low, high = places.min(axis=0).tolist(), places.max(axis=0).tolist()
        return cls(numbers[order], costs[order], lethal[order], places[order], (*low, *high))

    def is_same(self, other: SensedCosts) -> bool:
        """Whether the same vertices have the same values."""
        pairs = ((self.numbers, other.numbers), (self.costs, other.costs), (self.lethal, other.lethal))
        return all(np.array_equal(one, another) for one, another in pairs)

    def differing(self, other: SensedCosts) -> NDArray[np.int64]:
        """Numbers (k,) of the vertices whose values are not the same in both, ascending."""
        either = np.union1d(self.numbers, other.numbers)
        costs, lethal = np.full((2, len(either)), -1.0, dtype=np.float32), np.zeros((2, len(either)), dtype=np.bool_)
        for row, one in enumerate((self, other)):
            place = np.searchsorted(either, one.numbers)
            costs[row, place], lethal[row, place] = one.costs, one.lethal
        return np.asarray(either[(costs[0] != costs[1]) | (lethal[0] != lethal[1])])

    def laid_over(
        self, numbers: NDArray[np.int64], costs: Float32Array, lethal: BoolArray
    ) -> tuple[Float32Array, BoolArray] | None:
        """The worse of the values (n,) of some vertices, by their numbers (n,), and of these; None if none is here."""
        if not len(self.numbers):
            return None
        place = np.minimum(np.searchsorted(self.numbers, numbers), len(self.numbers) - 1)
        here = np.flatnonzero(self.numbers[place] == numbers)
        if not len(here):
            return None
        worse_costs, worse_lethal, place = costs.copy(), lethal.copy(), place[here]
        worse_costs[here] = np.maximum(costs[here], self.costs[place])
        worse_lethal[here] |= self.lethal[place]
        return worse_costs, worse_lethal


NOTHING_SENSED = SensedCosts(
    np.zeros(0, dtype=np.int64),
    np.zeros(0, dtype=np.float32),
    np.zeros(0, dtype=np.bool_),
    np.zeros((0, 3)),
    (0.0,) * 6,
)
