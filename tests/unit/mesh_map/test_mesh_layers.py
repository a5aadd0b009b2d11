"""The analysis layers against naive twins and hand-made surfaces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from mbf_abstract.geometry.polygon import inside_polygon
from mbf_mesh_nav.kernels.layers.neighbourhood_layers import height_differences
from mbf_mesh_nav.layers.border import BorderLayer
from mbf_mesh_nav.layers.clearance import ClearanceLayer
from mbf_mesh_nav.layers.height_diff import HeightDiffLayer
from mbf_mesh_nav.layers.keepout import KeepoutLayer
from mbf_mesh_nav.layers.label import LabelLayer
from mbf_mesh_nav.layers.ridge import RidgeLayer
from mbf_mesh_nav.layers.roughness import RoughnessLayer
from mbf_mesh_nav.layers.speed_limit import SpeedLimitLayer
from mbf_mesh_nav.layers.steepness import SteepnessLayer
from mbf_mesh_nav.map.layer import LayerContext, MeshLayer
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh


def computed(mesh: MeshMap, layer_class: type[MeshLayer], **parameters: object) -> MeshLayer:
    layer = layer_class(LayerContext("layer", mesh.topology, mesh.locator, layer_class.Parameters(**parameters)))
    layer.recompute()
    return layer


def bumpy(seed: int) -> MeshMap:
    return MeshMap.from_heights(np.random.default_rng(seed).random((9, 8)) * 0.2, 0.1, 0.1)


def neighbours(mesh: MeshMap, vertex: int) -> np.ndarray:
    return mesh.neighbours[mesh.neighbour_offsets[vertex] : mesh.neighbour_offsets[vertex + 1]]


def neighbourhood(mesh: MeshMap, centre: int, radius: float, plane: bool) -> list[int]:
    """Vertices reached over edges without leaving the radius; across the normal if ``plane``."""
    members, stack = {centre}, [centre]
    normal = mesh.vertex_normals[centre] if plane else np.zeros(3)
    while stack:
        for other in neighbours(mesh, stack.pop()):
            apart = mesh.vertices[other] - mesh.vertices[centre]
            apart = apart - normal * (normal @ apart)
            if other not in members and np.linalg.norm(apart) < radius:
                members.add(int(other))
                stack.append(int(other))
    return sorted(members - {centre})


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10_000), st.floats(0.05, 0.35))
def test_height_difference_equals_its_twin(seed, radius):
    mesh = bumpy(seed)

    layer = computed(mesh, HeightDiffLayer, radius=radius)

    for v, normal in enumerate(mesh.vertex_normals):
        heights = mesh.vertices[[v, *neighbourhood(mesh, v, radius, plane=True)]] @ normal
        assert layer.costs[v] == pytest.approx(heights.max() - heights.min(), abs=1e-6)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.floats(0.25, 0.5), st.floats(0.005, 0.2), st.floats(0.0, 0.3))
def test_height_difference_of_dense_meshes_takes_patches_and_keeps_every_bit(seed, radius, height_limit, left_out):
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0.0, 6.0, 45), np.linspace(0.0, 6.0, 35))
    heights = 0.03 * np.sin(x) * np.cos(y) + rng.random() * 0.01 * rng.random(x.shape)
    vertices, faces = heightfield_mesh(heights, 0.01, 0.01)
    mesh = MeshMap.from_arrays(vertices, faces[rng.random(len(faces)) >= left_out])
    surface = mesh.vertices, mesh.vertex_normals, mesh.neighbour_offsets, mesh.neighbours

    for limit in (height_limit, np.inf):
        layer = computed(mesh, HeightDiffLayer, radius=radius, height_limit=limit)
        np.testing.assert_array_equal(layer.costs, height_differences(*surface, radius, limit))


def test_height_difference_of_a_dense_mesh_does_not_reach_over_a_gap():
    low, faces = heightfield_mesh(np.zeros((20, 20)), 0.01, 0.01)
    vertices = np.vstack([low, low + np.array([0.0, 0.0, 0.1])])
    mesh = MeshMap.from_arrays(vertices, np.vstack([faces, faces + len(low)]))

    assert (computed(mesh, HeightDiffLayer, radius=0.3).costs == 0.0).all()


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10_000), st.floats(0.05, 0.35))
def test_roughness_equals_its_twin(seed, radius):
    mesh = bumpy(seed)
    normals = mesh.vertex_normals
    angles = [np.arccos(np.clip(normals[neighbours(mesh, v)] @ normals[v], -1, 1)).mean() for v in range(len(normals))]

    layer = computed(mesh, RoughnessLayer, radius=radius)

    for v in range(len(normals)):
        members = [v, *neighbourhood(mesh, v, radius, plane=False)]
        assert layer.costs[v] == pytest.approx(np.mean([angles[u] for u in members]), abs=1e-5)


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10_000), st.floats(0.05, 0.35))
def test_ridge_equals_its_twin(seed, radius):
    mesh = bumpy(seed)
    tips = mesh.vertices + mesh.vertex_normals

    layer = computed(mesh, RidgeLayer, radius=radius, threshold=0.3)

    for v in range(len(tips)):
        members = neighbourhood(mesh, v, radius, plane=False)
        expected = np.linalg.norm(tips[members] - tips[v], axis=1).mean() if members else 0.4
        assert layer.costs[v] == pytest.approx(expected, abs=1e-6)


def test_smooth_slope_costs_no_height_but_steepness():
    x = np.arange(8) * 0.1
    mesh = MeshMap.from_heights(np.tile(x * np.tan(0.4), (8, 1)), 0.1, 0.1)

    height, steep = computed(mesh, HeightDiffLayer), computed(mesh, SteepnessLayer, threshold=0.39)

    assert height.costs.max() < 1e-6
    np.testing.assert_allclose(steep.costs, 0.4, atol=1e-6)
    assert steep.lethal.all()
    assert not computed(mesh, SteepnessLayer, threshold=0.41).lethal.any()


def test_height_limit_keeps_the_cylinder_from_running_over_the_mesh():
    mesh = bumpy(3)

    assert computed(mesh, HeightDiffLayer, height_limit=0.05).costs.max() <= 0.1 + 1e-6
    np.testing.assert_array_equal(
        computed(mesh, HeightDiffLayer, height_limit=9.0).costs, computed(mesh, HeightDiffLayer).costs
    )


def test_border_marks_the_boundary_and_its_threshold_decides_what_is_lethal():
    mesh = MeshMap.from_heights(np.zeros((5, 6)), 1.0, 1.0)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    boundary = (x == 0) | (x == 5) | (y == 0) | (y == 4)

    layer = computed(mesh, BorderLayer, border_cost=0.4, threshold=0.5)

    np.testing.assert_allclose(layer.costs, np.where(boundary, 0.4, 0.0))
    assert not layer.lethal.any()
    np.testing.assert_array_equal(computed(mesh, BorderLayer).lethal, boundary)


@pytest.mark.parametrize(("ceiling", "cost", "lethal"), [(0.9, 1.0, True), (1.15, 0.5, False), (1.4, 0.0, False)])
def test_clearance_falls_from_one_below_the_robots_height_to_zero(ceiling, cost, lethal):
    vertices, faces = heightfield_mesh(np.zeros((4, 4)), 1.0, 1.0)
    storeys = np.vstack([vertices, vertices + np.array([0.0, 0.0, ceiling])])
    mesh = MeshMap.from_arrays(storeys, np.vstack([faces, faces + 16]))

    layer = computed(mesh, ClearanceLayer, robot_height=1.0, height_inflation=0.3)

    ground = mesh.vertices[:, 2] == 0.0
    np.testing.assert_allclose(layer.costs[ground], cost, atol=1e-5)
    assert (layer.lethal[ground] == lethal).all()
    assert (layer.costs[~ground] == 0.0).all()


def test_clearance_needs_the_robots_height():
    with pytest.raises(ValidationError, match="robot_height"):
        ClearanceLayer.Parameters()


def test_keepout_polygon_applies_to_its_storey_only():
    vertices, faces = heightfield_mesh(np.zeros((5, 5)), 1.0, 1.0)
    mesh = MeshMap.from_arrays(np.vstack([vertices, vertices + np.array([0, 0, 3.0])]), np.vstack([faces, faces + 25]))
    square = ((0.5, 0.5), (2.5, 0.5), (2.5, 1.5), (0.5, 1.5))

    layer = computed(mesh, KeepoutLayer, regions=[{"polygon": square, "z_max": 1.0}])

    marked = {tuple(point) for point in mesh.vertices[layer.lethal].tolist()}
    assert marked == {(1.0, 1.0, 0.0), (2.0, 1.0, 0.0)}


def test_what_lies_on_the_outline_of_a_region_is_closed_with_it():
    mesh = MeshMap.from_heights(np.zeros((6, 8)), 1.0, 1.0)
    triangle = ((1.0, 1.0), (7.0, 1.0), (4.0, 4.0))

    layer = computed(mesh, KeepoutLayer, regions=[{"polygon": triangle}])

    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    np.testing.assert_array_equal(layer.lethal, (y >= 1.0) & (y <= x) & (y <= 8.0 - x))


@pytest.mark.parametrize(("limit", "limit_type"), [(100.0, "percent"), (99.0, "percent"), (100.0, "absolute")])
def test_a_region_that_slows_nobody_down_is_noted(limit, limit_type):
    mesh = MeshMap.from_heights(np.zeros((5, 5)), 1.0, 1.0)
    region = {"polygon": ((0.5, 0.5), (2.5, 0.5), (2.5, 1.5)), "speed_limit": limit}
    noted = computed(mesh, SpeedLimitLayer, regions=[region], limit_type=limit_type).configuration_warning()
    assert noted.endswith("a speed_limit of 100 percent is no limit") == bool(noted)
    assert bool(noted) == (limit_type == "percent" and limit == 100.0)


def test_labels_give_costs_and_the_last_region_wins():
    mesh = MeshMap.from_heights(np.zeros((5, 5)), 1.0, 1.0)
    everything = ((-1.0, -1.0), (9.0, -1.0), (9.0, 9.0), (-1.0, 9.0))
    corner = ((-1.0, -1.0), (0.5, -1.0), (0.5, 0.5), (-1.0, 0.5))
    regions = [{"polygon": everything, "label": "lawn"}, {"polygon": corner, "label": "mud"}]

    layer = computed(mesh, LabelLayer, regions=regions, label_costs={"lawn": 0.3}, lethal_labels=["mud"])

    muddy = (mesh.vertices[:, :2] == 0.0).all(axis=1)
    np.testing.assert_allclose(layer.costs, np.where(muddy, 1.0, 0.3))
    np.testing.assert_array_equal(layer.lethal, muddy)


def test_label_without_a_cost_and_polygon_without_inside_are_refused():
    with pytest.raises(ValidationError, match=r"a cost for every label.*: sand"):
        LabelLayer.Parameters(regions=[{"polygon": ((0, 0), (1, 0), (0, 1)), "label": "sand"}])
    with pytest.raises(ValidationError, match="at least 3 corners"):
        KeepoutLayer.Parameters(regions=[{"polygon": ((0, 0), (1, 0))}])


@pytest.mark.parametrize(("scale", "offset"), [(1e-3, 0.0), (1.0, 1e4)])
def test_layers_do_not_depend_on_scale_and_offset(scale, offset):
    plain = bumpy(5)
    moved = MeshMap.from_arrays(
        plain.to_input_order(plain.vertices) * scale + offset, plain.internal_to_input[plain.faces]
    )

    for layer_class in (HeightDiffLayer, RoughnessLayer):
        expected = computed(plain, layer_class, radius=0.25)
        found = computed(moved, layer_class, radius=0.25 * scale)
        unit = scale if layer_class is HeightDiffLayer else 1.0
        np.testing.assert_allclose(
            moved.to_input_order(found.costs), plain.to_input_order(expected.costs) * unit, rtol=1e-4, atol=1e-9
        )


def crosses(p, q, a, b):
    """Whether two segments share a point that is an end of neither."""
    side = lambda u, v, w: np.sign((v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0]))  # noqa: E731
    return side(p, q, a) * side(p, q, b) < 0 and side(a, b, p) * side(a, b, q) < 0


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), width=st.floats(0.001, 0.6))
def test_no_free_edge_leads_through_a_keepout_region_however_narrow(seed, width):
    rng = np.random.default_rng(seed)
    mesh = MeshMap.from_heights(np.zeros((12, 12)), 0.25, 0.25)
    begin, end = rng.uniform(0.3, 2.4, (2, 2))
    aside = np.array([begin[1] - end[1], end[0] - begin[0]]) / np.linalg.norm(end - begin) * width / 2.0
    outline = [begin + aside, end + aside, end - aside, begin - aside]
    layer = computed(mesh, KeepoutLayer, regions=[{"polygon": [tuple(corner) for corner in outline]}])
    sides = list(zip(outline, [*outline[1:], outline[0]], strict=True))
    assert layer.lethal.any()
    for p, q in mesh.edges[~layer.lethal[mesh.edges].any(axis=1)]:
        assert not any(crosses(mesh.vertices[p], mesh.vertices[q], a, b) for a, b in sides)


def test_a_keepout_region_inside_one_face_closes_that_face():
    mesh = MeshMap.from_heights(np.zeros((3, 3)), 1.0, 1.0)
    layer = computed(mesh, KeepoutLayer, regions=[{"polygon": [(0.2, 0.2), (0.3, 0.2), (0.25, 0.3)]}])
    closed = mesh.faces[mesh.locate([[0.25, 0.23, 0.0]]).faces[0]]
    assert set(np.flatnonzero(layer.lethal)) == set(closed.tolist())


@pytest.mark.parametrize(
    "polygon",
    [
        [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)],
        [(2.0, 1.0), (1.0, 2.0), (2.0, 2.0)],
        [(1.5, 1.0), (1.5, 1.5), (1.0, 1.5)],
    ],
    ids=["cell", "face", "corners on edges"],
)
def test_a_keepout_region_drawn_along_the_edges_of_the_mesh_leaves_no_face_of_it_free(polygon):
    mesh = MeshMap.from_heights(np.zeros((5, 5)), 1.0, 1.0)
    layer = computed(mesh, KeepoutLayer, regions=[{"polygon": polygon}])
    free = mesh.faces[~layer.lethal[mesh.faces].any(axis=1)]
    shares = np.random.default_rng(0).dirichlet((1.0, 1.0, 1.0), 200)
    inside = inside_polygon(np.einsum("ks,fsc->fkc", shares, mesh.vertices[free]).reshape(-1, 3), np.array(polygon))
    assert len(free) > 0 and not inside.any()


def test_a_forbidden_label_closes_a_band_that_runs_between_the_vertices():
    mesh = MeshMap.from_heights(np.zeros((5, 5)), 1.0, 1.0)
    band = {"polygon": ((2.4, -1.0), (2.6, -1.0), (2.6, 9.0), (2.4, 9.0)), "label": "mud"}
    forbidden = computed(mesh, LabelLayer, regions=[band], lethal_labels=["mud"])
    costly = computed(mesh, LabelLayer, regions=[band], label_costs={"mud": 0.5})
    crossing = (mesh.vertices[mesh.edges][:, :, 0] < 2.5).any(axis=1) & (mesh.vertices[mesh.edges][:, :, 0] > 2.5).any(
        axis=1
    )
    assert forbidden.lethal[mesh.edges[crossing]].any(axis=1).all()
    assert not costly.lethal.any() and not costly.costs.any()


def test_a_region_whose_heights_are_exchanged_is_refused():
    with pytest.raises(ValueError, match="z_min 2 m is above z_max 1 m"):
        KeepoutLayer.Parameters(regions=[{"polygon": ((0, 0), (1, 0), (0, 1)), "z_min": 2.0, "z_max": 1.0}])
