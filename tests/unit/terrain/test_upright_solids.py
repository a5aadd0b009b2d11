"""Boxes and cylinders of the kinematic world against the ray tree and Bullet's answers to the same questions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from terrain.sensors.rays import StaticRays
from terrain.worlds.surface import cylinder
from terrain.worlds.upright_solids import SolidRays, UprightSolid

SIZES = {"box": (1.2, 0.5, 1.6), "cylinder": (0.4, 1.6)}


@pytest.mark.parametrize("name", SIZES)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), yaw=st.floats(-3.1, 3.1))
def test_rays_meet_a_solid_where_they_meet_its_triangles(name: str, seed: int, yaw: float) -> None:
    rng = np.random.default_rng(seed)
    solid = UprightSolid(Pose.planar(1.0, -2.0, yaw, 0.8), SIZES[name], moving=True)
    starts = np.array([1.0, -2.0, 0.8]) + 4.0 * _unit(rng.normal(size=(300, 3)))
    aims = _unit(np.array([1.0, -2.0, 0.8]) + 0.6 * rng.normal(size=(300, 3)) - starts)
    vertices, faces = solid.surface()
    if name == "cylinder":  # the prism of 24 sides lies up to 1 % of its radius inside
        vertices, faces = cylinder(*SIZES[name], sides=720)
        vertices = vertices + np.array([1.0, -2.0, 0.8])

    ours = SolidRays([solid]).distances(starts, aims, 10.0)
    tree = StaticRays(vertices, faces).distances(starts, aims, 10.0)

    both = np.isfinite(ours) & np.isfinite(tree)
    assert both.sum() > 50
    assert (np.isfinite(ours) != np.isfinite(tree)).sum() <= 2  # rays that graze an edge
    assert np.sort(np.abs(ours[both] - tree[both]))[:-2].max() < 2e-3


@given(x=st.floats(-3.0, 3.0), y=st.floats(-3.0, 3.0), yaw=st.floats(-3.1, 3.1))
def test_the_distance_of_a_box_is_that_of_its_nearest_outline_point(x: float, y: float, yaw: float) -> None:
    solid = UprightSolid(Pose.planar(0.3, 0.2, yaw), SIZES["box"])
    along, across = np.meshgrid(np.linspace(-0.6, 0.6, 121), np.linspace(-0.25, 0.25, 51))
    points = np.column_stack([along.ravel(), across.ravel()])
    turned = points @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) + (0.3, 0.2)
    assert solid.distance(x, y) == pytest.approx(np.linalg.norm(turned - (x, y), axis=1).min(), abs=0.01)


def test_the_distance_of_a_cylinder_counts_from_its_side_and_what_stands_still_is_not_cast() -> None:
    solid = UprightSolid(Pose.planar(1.0, 0.0), SIZES["cylinder"])
    assert (solid.distance(3.0, 0.0), solid.distance(1.1, 0.0)) == (pytest.approx(1.6), 0.0)
    ray = np.array([[-1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]])
    assert np.isinf(SolidRays([solid]).distances(*ray, 10.0)).all()
    solid.moving = True
    assert SolidRays([solid]).distances(*ray, 10.0) == pytest.approx([1.6])
    assert np.isinf(SolidRays([solid]).distances(*ray, 1.5)).all()


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
