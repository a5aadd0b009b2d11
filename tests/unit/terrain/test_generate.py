"""Generated terrain: as steep and as rough as asked, the same for the same seed."""

import numpy as np
import pytest

from terrain.scenarios.world_types import GeneratedWorld
from terrain.worlds import generate
from terrain.worlds.generate import flat_terrain, fractal_terrain


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize("slope", [3.0, 12.0, 25.0])
def test_fractal_ground_has_the_median_slope_asked_for(slope: float) -> None:
    terrain = fractal_terrain(20.0, 15.0, 0.2, rng(), median_slope=slope)
    assert terrain.slope_report().median == pytest.approx(slope, abs=0.05)
    assert terrain.size == pytest.approx((20.0, 15.0))


def test_same_seed_same_ground_other_seed_other_ground() -> None:
    grounds = [fractal_terrain(10.0, 10.0, 0.2, rng(seed), roughness=0.01).heights for seed in (1, 1, 2)]
    assert np.array_equal(grounds[0], grounds[1]) and not np.array_equal(grounds[0], grounds[2])


def test_roughness_is_the_root_mean_square_of_the_bumps() -> None:
    flat = flat_terrain(10.0, 10.0, 0.1)
    assert np.std(generate.add_roughness(flat, rng(), 0.03).heights) == pytest.approx(0.03, rel=1e-3)


def test_the_report_separates_steep_ground_from_rough_ground() -> None:
    reports = {}
    for slope, roughness in ((5.0, 0.0), (15.0, 0.0), (5.0, 0.03)):
        rng = np.random.default_rng(3)
        reports[slope, roughness] = fractal_terrain(20.0, 20.0, 0.1, rng, slope, roughness).slope_report()
    assert reports[15.0, 0.0].median > reports[5.0, 0.03].median > reports[5.0, 0.0].median
    assert reports[5.0, 0.03].roughness > 1.5 * reports[15.0, 0.0].roughness > 3.0 * reports[5.0, 0.0].roughness
    assert "roughness" in str(reports[5.0, 0.03])


def test_ridge_crest_and_crater_bottom_have_their_heights() -> None:
    flat = flat_terrain(20.0, 20.0, 0.1)
    ridge = generate.add_ridge(flat, np.array([[10.0, 0.0], [10.0, 20.0]]), 2.0, 4.0)
    assert float(ridge.height_at(10.0, 7.0)) == pytest.approx(2.0, abs=1e-3)
    assert abs(float(ridge.height_at(2.0, 7.0))) < 1e-3
    crater = generate.add_crater(flat, 10.0, 10.0, 4.0, 1.5)
    assert float(crater.height_at(10.0, 10.0)) == pytest.approx(-1.5)
    assert crater.heights.max() == pytest.approx(0.3, abs=0.03)


def test_ruts_run_on_both_sides_of_the_line() -> None:
    ruts = generate.add_ruts(flat_terrain(10.0, 10.0, 0.05), np.array([[0.0, 5.0], [10.0, 5.0]]), 0.6, 0.3, 0.1)
    assert ruts.height_at(5.0, [4.7, 5.0, 5.3]).tolist() == pytest.approx([-0.1, 0.0, -0.1], abs=1e-3)


def test_boulders_leave_start_and_goal_clear() -> None:
    flat = flat_terrain(20.0, 20.0, 0.1)
    ends = np.array([[3.0, 3.0], [17.0, 17.0]])
    rubble = generate.add_boulders(flat, rng(), 60.0, keep_clear=ends)
    angle = np.linspace(0.0, 2.0 * np.pi, 50)
    for x, y in ends:
        assert np.all(rubble.height_at(x + 1.8 * np.cos(angle), y + 1.8 * np.sin(angle)) == 0.0)
    assert 0.1 < rubble.heights.max() <= 0.8


def test_steps_rise_along_x() -> None:
    stairs = generate.add_steps(flat_terrain(10.0, 2.0, 0.1), 3.05, 0.15, 1.0, 4)
    assert stairs.height_at([2.5, 3.5, 4.5, 9.0], 1.0).tolist() == pytest.approx([0.0, 0.15, 0.3, 0.6], abs=1e-6)


def test_a_road_has_its_own_heights_and_leaves_the_far_ground_alone() -> None:
    hills = fractal_terrain(20.0, 20.0, 0.1, rng(), median_slope=15.0)
    road = generate.add_road(hills, np.array([[2.0, 5.0, 0.0], [18.0, 5.0, 1.6]]), 2.0, 1.0)
    assert road.height_at([6.0, 10.0], [4.6, 5.4]).tolist() == pytest.approx([0.4, 0.8], abs=1e-3)
    assert np.allclose(road.height_at([5.0, 10.0], 15.0), hills.height_at([5.0, 10.0], 15.0))


def test_level_ground_of_a_scenario_may_be_rough():
    world = GeneratedWorld(type="generated", size=(10.0, 8.0), roughness=0.05)
    ground = world.heightfield(np.random.default_rng(0), np.zeros((0, 2)))
    assert float(np.sqrt(np.mean(np.square(ground.heights)))) == pytest.approx(0.05, rel=1e-3)
