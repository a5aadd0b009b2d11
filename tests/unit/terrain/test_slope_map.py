"""Hills as a 2D map: grey by slope, the same through a file."""

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from terrain.worlds.heightfield import Heightfield
from terrain.worlds.slope_map import OCCUPIED, cell_slopes, slope_grid, slope_occupancy, write_slope_map


def plane(degrees: float) -> Heightfield:
    _, x = np.mgrid[0:41, 0:61] * 0.25
    return Heightfield(x * math.tan(math.radians(degrees)), 0.25, 0.25, -2.0, 3.0)


@pytest.mark.parametrize(("nx", "ny", "shape"), [(2, 2, (1, 1)), (4, 2, (1, 3)), (2, 3, (2, 1))])
def test_a_terrain_of_few_samples_has_a_map_of_few_cells(nx: int, ny: int, shape: tuple[int, int]) -> None:
    _, x = np.mgrid[0:ny, 0:nx] * 1.0
    slopes = cell_slopes(Heightfield(x, 1.0, 1.0), 1.0)
    assert slopes == pytest.approx(np.full(shape, 45.0 if nx > 2 else 0.0))


@pytest.mark.parametrize(("degrees", "occupancy"), [(3.0, 0), (17.5, 50), (35.0, 100)])
def test_occupancy_rises_with_slope(degrees: float, occupancy: int) -> None:
    inner = (slice(8, -8), slice(8, -8))
    assert cell_slopes(plane(degrees), 0.2)[inner] == pytest.approx(degrees, abs=0.2)
    assert np.abs(slope_occupancy(plane(degrees), 0.2)[inner].astype(int) - occupancy).max() <= 1


def test_the_border_is_occupied_and_cells_lie_on_the_terrain() -> None:
    grid = slope_grid(plane(10.0), 0.2)
    assert grid.occupied[0].all() and grid.occupied[:, -1].all() and not grid.occupied[20, 20]
    assert grid.bounds == pytest.approx((-2.0, 13.0, 3.0, 13.0))


def test_small_bumps_are_no_slopes() -> None:
    _, ix = np.mgrid[0:100, 0:100]
    washboard = Heightfield(0.02 * (ix % 2), 0.1, 0.1)
    assert np.median(washboard.slopes()) > 10.0
    assert np.median(cell_slopes(washboard, 0.05)) < 1.0


def test_a_written_map_holds_the_occupancies(tmp_path: Path) -> None:
    file = write_slope_map(plane(17.5), tmp_path, "hills", 0.2)
    assert "mode: raw" in file.read_text()
    assert np.array_equal(np.asarray(Image.open(tmp_path / "hills.png"))[::-1], slope_occupancy(plane(17.5), 0.2))
    assert slope_occupancy(plane(17.5), 0.2).max() == OCCUPIED
