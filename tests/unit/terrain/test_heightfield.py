"""The heightfield is the anti-diagonal triangulation, in every query."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrain.worlds.heightfield import Heightfield


def random_field(seed: int = 0, ny: int = 7, nx: int = 11) -> Heightfield:
    heights = np.random.default_rng(seed).normal(0.0, 1.0, (ny, nx))
    return Heightfield(heights, 0.2, 0.3, -1.0, 5.0)


def height_by_triangle_search(field: Heightfield, x: float, y: float) -> float:
    """Look at every triangle until one contains (x, y): the slow twin of ``height_at``."""
    vertices, faces = field.surface()
    for a, b, c in vertices[faces]:
        basis = np.column_stack([b[:2] - a[:2], c[:2] - a[:2]])
        s, t = np.linalg.solve(basis, np.array([x, y]) - a[:2])
        if s >= -1e-12 and t >= -1e-12 and s + t <= 1.0 + 1e-12:
            return float(a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]))
    return float("nan")


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 5), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_height_at_equals_a_search_through_all_triangles(seed: int, u: float, v: float) -> None:
    field = random_field(seed)
    x, y = field.x0 + u * field.size[0], field.y0 + v * field.size[1]
    assert float(field.height_at(x, y)) == pytest.approx(height_by_triangle_search(field, x, y), abs=1e-9)


def test_samples_are_kept_exactly_and_outside_is_nan() -> None:
    field = random_field()
    vertices, _ = field.surface()
    assert np.allclose(field.height_at(vertices[:, 0], vertices[:, 1]), vertices[:, 2], atol=1e-6)
    assert np.isnan(field.height_at([field.x0 - 0.01, field.x_max + 0.01, np.nan], [6.0, 6.0, 6.0])).all()


def test_the_cell_is_split_along_the_anti_diagonal() -> None:
    field = Heightfield(np.array([[0.0, 1.0], [1.0, 0.0]]), 1.0, 1.0)
    assert field.height_at(0.5, 0.5) == 1.0  # the main diagonal would give 0


def test_faces_look_up_and_cover_the_rectangle() -> None:
    field = random_field()
    vertices, faces = field.surface()
    a, b, c = (vertices[faces[:, k], :2] for k in range(3))
    doubled_areas = np.cross(np.c_[b - a, np.zeros(len(a))], np.c_[c - a, np.zeros(len(a))])[:, 2]
    assert (doubled_areas > 0).all()
    assert doubled_areas.sum() / 2 == pytest.approx(field.size[0] * field.size[1])


def normal_of_face(field: Heightfield, x: float, y: float) -> np.ndarray:
    """Unit normal of the face of the mesh under a place."""
    u, v = (x - field.x0) / field.dx, (y - field.y0) / field.dy
    ix, iy = min(int(u), field.nx - 2), min(int(v), field.ny - 2)
    vertices, faces = field.surface()
    a, b, c = vertices[faces[2 * (iy * (field.nx - 1) + ix) + int(u - ix + v - iy > 1.0)]]
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal)


def test_normal_and_slope_of_a_tilted_plane() -> None:
    x = np.arange(6) * 0.5
    field = Heightfield(np.tile(x, (4, 1)), 0.5, 0.25)
    assert np.allclose(normal_of_face(field, 1.3, 0.3), np.array([-1.0, 0.0, 1.0]) / np.sqrt(2))
    assert field.slope_report().median == pytest.approx(45.0)
    assert field.slope_report().relief == pytest.approx(2.5)


def test_scaling_keeps_slopes() -> None:
    field = random_field()
    assert np.allclose(field.scaled(1 / 300).slopes(), field.slopes(), atol=1e-3)


def test_crop_keeps_the_surface() -> None:
    field = random_field(ny=20, nx=20)
    part = field.crop(-0.5, 1.5, 6.0, 8.0)
    assert part.x0 >= -0.5 and part.x_max <= 1.5 and part.y0 >= 6.0 and part.y_max <= 8.0
    assert np.allclose(part.height_at(0.33, 7.1), field.height_at(0.33, 7.1), atol=1e-6)
    with pytest.raises(ValueError, match=r"expected a part of x -1 to 2\.8"):
        field.crop(100.0, 101.0, 0.0, 1.0)


def test_resampling_of_a_plane_is_exact() -> None:
    y, x = np.mgrid[0:9, 0:12]
    field = Heightfield(0.1 * x + 0.3 * y, 1.0, 1.0)
    fine = field.resample(0.25)
    assert fine.dx == pytest.approx(0.25) and fine.size == pytest.approx(field.size)
    assert float(fine.height_at(5.5, 4.25)) == pytest.approx(0.55 + 1.275, abs=1e-5)


@pytest.mark.parametrize(
    ("heights", "dx", "text"),
    [
        (np.zeros((1, 5)), 1.0, "2 x 2"),
        (np.zeros(5), 1.0, "2 x 2"),
        (np.full((3, 3), np.nan), 1.0, r"height \[0, 0\]"),
        (np.zeros((3, 3)), 0.0, "positive"),
    ],
)
def test_a_bad_grid_is_refused(heights: np.ndarray, dx: float, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        Heightfield(heights, dx, 1.0)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 5), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_fast_single_query_equals_the_array_queries(seed: int, u: float, v: float) -> None:
    field = random_field(seed)
    x, y = field.x0 + u * field.size[0], field.y0 + v * field.size[1]
    height, slope_x, slope_y = field.ground_at(x, y)
    assert height == pytest.approx(float(field.height_at(x, y)), abs=1e-9)
    edge_distance = abs((u * 10) % 1.0 + (v * 6) % 1.0 - 1.0)
    if edge_distance > 1e-6 and 0.0 < (u * 10) % 1.0 and 0.0 < (v * 6) % 1.0:  # on an edge both normals are right
        normal = np.array([-slope_x, -slope_y, 1.0]) / np.sqrt(1.0 + slope_x**2 + slope_y**2)
        assert normal == pytest.approx(normal_of_face(field, x, y), abs=1e-6)


@given(st.integers(0, 5), st.floats(0.05, 0.95), st.floats(-3.1, 3.1))
def test_a_pose_stands_on_the_ground_and_looks_where_it_should(seed: int, u: float, yaw: float) -> None:
    field = random_field(seed)
    x, y = field.x0 + u * field.size[0], field.y0 + (1.0 - u) * field.size[1]
    pose = field.pose_at(x, y, yaw)
    _, slope_x, slope_y = field.ground_at(x, y)
    forward, up = pose.rotation[:, 0], pose.rotation[:, 2]
    assert up == pytest.approx(np.array([-slope_x, -slope_y, 1.0]) / np.sqrt(1.0 + slope_x**2 + slope_y**2), abs=1e-9)
    assert np.cos(np.arctan2(forward[1], forward[0]) - yaw) == pytest.approx(1.0, abs=1e-9)
    with pytest.raises(ValueError, match="off the terrain"):
        field.pose_at(field.x0 - 0.1, y)
