"""What Bullet collides with and what the planner plans on are one surface (issue 2, under 1 mm)."""

import numpy as np
import pytest
import trimesh

from terrain.physics.world import MAX_HEIGHTFIELD_SAMPLES, BulletWorld
from terrain.worlds.elevation_files import jacksboro
from terrain.worlds.generate import fractal_terrain
from terrain.worlds.heightfield import Heightfield

LIMIT = 1e-3


def real_terrain() -> Heightfield:
    return jacksboro(100.0, spacing=0.35, roughness=0.02, rng=np.random.default_rng(7))


def high_above_the_sea() -> Heightfield:
    hills = fractal_terrain(16.0, 14.4, 0.2, np.random.default_rng(5), median_slope=20.0)
    return Heightfield(hills.heights[:48] + 500.0, 0.2, 0.3, -37.0, 11.0)


@pytest.mark.parametrize("make_terrain", [real_terrain, high_above_the_sea])
def test_a_thousand_vertical_rays_meet_the_triangles(make_terrain: type[Heightfield]) -> None:
    terrain = make_terrain()
    rng = np.random.default_rng(11)
    xy = np.column_stack([rng.uniform(terrain.x0, terrain.x_max, 1000), rng.uniform(terrain.y0, terrain.y_max, 1000)])
    mesh = trimesh.Trimesh(*terrain.surface(), process=False)

    with BulletWorld() as world:
        world.add_heightfield(terrain)
        bullet_heights = world.vertical_rays(xy)

    mesh_heights = mesh_heights_below(mesh, xy)
    assert np.isfinite(bullet_heights).all()
    assert np.abs(bullet_heights - terrain.height_at(xy[:, 0], xy[:, 1])).max() < LIMIT
    assert np.nanmax(np.abs(bullet_heights - mesh_heights)) < LIMIT and np.isfinite(mesh_heights).mean() > 0.99


def mesh_heights_below(mesh: trimesh.Trimesh, xy: np.ndarray) -> np.ndarray:
    """Heights where vertical rays meet the mesh, by trimesh; nan where a ray slips through an edge."""
    origins = np.column_stack([xy, np.full(len(xy), mesh.bounds[1, 2] + 1.0)])
    points, rays, _ = mesh.ray.intersects_location(
        origins, np.tile([0.0, 0.0, -1.0], (len(xy), 1)), multiple_hits=False
    )
    heights = np.full(len(xy), np.nan)
    heights[rays] = points[:, 2]
    return heights


def test_the_silent_size_limit_is_an_error() -> None:
    too_large = Heightfield(np.zeros((1449, 1449), np.float32), 0.1, 0.1)
    assert too_large.heights.size > MAX_HEIGHTFIELD_SAMPLES
    with BulletWorld() as world, pytest.raises(ValueError, match="1449 x 1449"):
        world.add_heightfield(too_large)


def test_the_sign_trap_is_avoided_slanted_rays_hit_ground_high_above_the_sea() -> None:
    terrain = high_above_the_sea()
    starts = np.array([[terrain.x0 + 1.0, terrain.y0 + 1.0, float(terrain.heights.max()) + 1.0]] * 200)
    ends = np.column_stack([np.linspace(-30.0, -22.0, 200), np.linspace(15.0, 22.0, 200), np.full(200, 480.0)])
    with BulletWorld() as world:
        world.add_heightfield(terrain)
        hit_heightfield, on_heightfield = world.cast_rays(starts, ends)
    with BulletWorld() as world:
        world.add_mesh(*terrain.surface())
        hit_mesh, on_mesh = world.cast_rays(starts, ends)
    assert hit_mesh.sum() > 100
    assert np.array_equal(hit_heightfield, hit_mesh)
    assert np.abs(on_heightfield - on_mesh).max() < LIMIT
