"""Small maps for the tests of this folder."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap

# The 10 x 10 test map of costmap_2d and Nav2, top row first: # is an obstacle.
TEN_BY_TEN = """
..........
..........
.......###
....#..###
....#..###
..........
..........
...###....
.......###
.......###
"""


def lethal_cells(costmap: LayeredCostmap) -> set[tuple[int, int]]:
    """Lethal cells (ix, iy) of a costmap as it is now."""
    return {(int(ix), int(iy)) for iy, ix in np.argwhere(costmap.snapshot().cells == LETHAL)}


def cells_of(picture: str) -> np.ndarray:
    """Cells of a picture, top row first: . free, # lethal, i inscribed, ? unknown."""
    rows = picture.split()
    values = {".": 0, "#": 254, "i": 253, "?": 255}
    return np.array([[values[character] for character in row] for row in rows[::-1]], dtype=np.uint8)


@pytest.fixture
def ten_by_ten() -> Costmap:
    return Costmap(cells_of(TEN_BY_TEN), 1.0)


@pytest.fixture
def picture() -> Callable[[str], np.ndarray]:
    return cells_of


@pytest.fixture
def build(ten_by_ten: Costmap) -> Callable[..., LayeredCostmap]:
    """Make a map of 1 m cells for a point robot: ``build("static", "obstacle", obstacle={...}, width=10)``."""

    def make(*types: str, **settings: Any) -> LayeredCostmap:
        blocks = {name: settings.pop(name) for name in types if name in settings}
        footprint = settings.pop("outline", None)
        parameters = CostmapParameters.model_validate(
            {
                "resolution": 1.0,
                "robot_radius": 0.0,
                "footprint_padding": 0.0,
                "footprint": footprint,
                "layers": [{"name": name, "type": name} for name in types],
                **settings,
            }
        )
        return build_layered_costmap(parameters, blocks, static_map=ten_by_ten)

    return make


@pytest.fixture
def seeing() -> dict[str, Any]:
    """Block of an obstacle layer with one source "laser" with a long range and no decay, as in costmap_2d."""
    laser = {
        "obstacle_max_range": 100.0,
        "raytrace_max_range": 100.0,
        "expected_update_rate": 0.0,
        "observation_persistence": 10.0,
    }
    return {"footprint_clearing_enabled": False, "sources": {"laser": laser}}
