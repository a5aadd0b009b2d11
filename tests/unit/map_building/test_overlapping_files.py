"""Files that disagree in height where they overlap are named; storeys, slopes and files that agree are not."""

from pathlib import Path

import numpy as np
import pytest
from surveyed_ground import flat, ground, hills

from mbf_mesh_nav.building.clouds.overlapping_files import disagreements
from mbf_mesh_nav.building.clouds.point_cloud import read_clouds

WEST, EAST = Path("west.las"), Path("east.las")


def tiles(height=hills, above=0.0, overlap=4.0):
    """Two tiles of one ground, the eastern one ``above`` [m] the western one."""
    rng = np.random.default_rng(3)
    east = ground(rng, lambda x, y: height(x + 16.0 - overlap, y))
    east += (16.0 - overlap, 0.0, above)
    return [ground(rng, height), east]


@pytest.mark.parametrize("above", [-0.3, 0.1, 0.3])
def test_a_tile_that_lies_above_the_other_is_named_with_the_difference(above):
    (note,) = disagreements([WEST, EAST], tiles(above=above))
    upper, lower = ("east.las", "west.las") if above > 0 else ("west.las", "east.las")
    assert note.startswith(f"{upper} lies {abs(above):.2f} m above {lower} where they overlap (")


def test_the_difference_is_found_among_grass_and_trees_too():
    west, east = tiles(above=0.1)
    rng = np.random.default_rng(4)
    for part in (west, east):
        part[rng.random(len(part)) < 0.2, 2] += 0.3
    assert len(disagreements([WEST, EAST], [west, east])) == 1


@pytest.mark.parametrize(
    "parts",
    [tiles(), tiles(above=0.03), tiles(flat, above=3.0), tiles(above=0.3, overlap=0.5), tiles(above=0.3, overlap=-2.0)],
    ids=["they agree", "within noise", "storeys", "hardly an overlap", "no overlap"],
)
def test_tiles_that_agree_or_cannot_be_compared_give_no_note(parts):
    assert disagreements([WEST, EAST], parts) == []


def test_who_builds_a_map_reads_it_among_the_notes(tmp_path):
    files = [tmp_path / name for name in ("west.xyz", "east.xyz")]
    for file, part in zip(files, tiles(above=0.2), strict=True):
        np.savetxt(file, part, fmt="%.4f")
    assert any("east.xyz lies 0.20 m above west.xyz" in note for note in read_clouds(files).notes)
