"""The shortest way over a surface: exact where that is known, never shorter and at most 3 % longer."""

import csv
import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from terrain.worlds import geodesics
from terrain.worlds.generate import fractal_terrain
from terrain.worlds.geodesics import free_floor, geodesic_length
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.occupancy import OccupancyGrid
from terrain.worlds.surface import Surface

LONGEST = 1.03


def plane(degrees):
    _, ix = np.mgrid[0:33, 0:41]
    return Heightfield(0.25 * ix * math.tan(math.radians(degrees)), 0.25, 0.25)


@pytest.mark.parametrize("angle", np.linspace(0.0, math.pi / 2.0, 7))
def test_on_a_slanted_plane_it_is_the_straight_line(angle):
    terrain = plane(30.0)
    x, y = 1.03 + 6.0 * math.cos(angle), 1.11 + 6.0 * math.sin(angle)
    places = [(px, py, float(terrain.height_at(px, py))) for px, py in ((1.03, 1.11), (x, y))]
    straight = math.dist(*places)
    assert straight * (1.0 - 1e-9) <= geodesic_length(terrain.surface(), places) <= LONGEST * straight


def test_it_is_close_to_the_exact_geodesics_of_real_ground(shared_data):
    with (shared_data / "terrain" / "geodesic_reference.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["mesh"] == "terrain/dem/kootenai_1m.ply"]
    mesh = trimesh.load(shared_data / rows[0]["mesh"], process=False)
    surface = Surface(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int32))
    assert len(rows) >= 8
    for row in rows:
        places = [tuple(float(row[end + axis]) for axis in "xyz") for end in "st"]
        exact = float(row["exact_mmp"])
        assert exact * (1.0 - 1e-6) <= geodesic_length(surface, places) <= LONGEST * exact


def test_legs_over_several_places_add_up():
    surface, places = plane(0.0).surface(), [(1.0, 1.0, 0.0), (4.0, 1.0, 0.0), (4.0, 3.0, 0.0)]
    assert geodesic_length(surface, places) == pytest.approx(5.0)


def test_in_a_building_it_leads_through_the_door_and_not_through_a_wall():
    occupied = np.zeros((100, 100), dtype=bool)
    occupied[:80, 48:52] = True
    floor = free_floor(OccupancyGrid(occupied, ~occupied, 0.05, 0.0, 0.0))
    around = 2.0 * math.hypot(1.4, 3.0) + 0.2
    assert around <= geodesic_length(floor, [(1.0, 1.0, 0.0), (4.0, 1.0, 0.0)]) <= LONGEST * around


def test_there_is_no_way_to_where_no_surface_is():
    surface = plane(0.0).surface()
    assert geodesic_length(surface, [(1.0, 1.0, 0.0), (1.0, 1.0, 9.0)]) == math.inf
    occupied = np.zeros((20, 20), dtype=bool)
    occupied[:, 8:12] = True
    floor = free_floor(OccupancyGrid(occupied, ~occupied, 0.2, 0.0, 0.0))
    assert geodesic_length(floor, [(1.0, 1.0, 0.0), (3.0, 1.0, 0.0)]) == math.inf


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 1000),
    stops=st.lists(st.tuples(st.floats(1.0, 19.0), st.floats(1.0, 15.0)), min_size=2, max_size=4),
    detour=st.floats(1.0, 1.6),
    walls=st.integers(0, 8),
)
def test_where_it_looks_first_and_what_was_driven_do_not_change_the_length(seed, stops, detour, walls):
    """Gaps of up to 10 m are in the way, so that paths are far longer than the straight line; some ends are cut off."""
    rng = np.random.default_rng(seed)
    terrain = fractal_terrain(20.0, 16.0, 0.25, rng, median_slope=12.0)
    whole = terrain.surface()
    middles = whole.vertices[whole.faces].mean(axis=1)[:, :2]
    kept = np.ones(len(middles), dtype=bool)
    for _ in range(walls):
        corner = rng.uniform(0.0, 16.0, size=2)
        size = rng.permutation([0.6, rng.uniform(3.0, 10.0)])
        kept &= ~((corner <= middles) & (middles <= corner + size)).all(axis=1)
    surface = Surface(whole.vertices, whole.faces[kept])
    places = [(x, y, float(terrain.height_at(x, y))) for x, y in stops]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(geodesics, "DETOUR", 1e6)  # all at once
        length = geodesic_length(surface, places)

    assert geodesic_length(surface, places) == length
    if math.isfinite(length):
        assert geodesic_length(surface, places, detour * length) == length
