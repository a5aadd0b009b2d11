"""Sensed obstacles on the map: projection, storeys, decay, clearing, freshness, and the snapshots they lead to."""

import numpy as np
import pytest
from seen_floor import SENSOR, floor_map, post, see

from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_mesh_nav.map.range_image import RangeImage


def test_post_makes_the_corners_of_the_face_below_lethal_and_inflates_them():
    mesh = floor_map()

    see(mesh, post(2.05, 2.02), 1.0)

    snapshot = mesh.snapshot()
    lethal = mesh.vertices[snapshot.lethal]
    assert len(lethal) == 3
    assert (np.linalg.norm(lethal - [2.05, 2.02, 0.0], axis=1) < 0.3).all()
    assert np.isinf(snapshot.costs[snapshot.lethal]).all()
    near = np.linalg.norm(mesh.vertices - [2.05, 2.02, 0.0], axis=1) < 0.4
    assert (snapshot.costs[near] > 0.0).all()


def test_each_face_is_marked_by_what_stands_above_it():
    for face in (0, 1, -1):
        mesh = floor_map()
        corners = mesh.faces[face]
        see(mesh, post(*mesh.vertices[corners].mean(axis=0)[:2].tolist()), 1.0)
        assert set(np.flatnonzero(mesh.layers["seen"].lethal)) == set(corners.tolist())


def test_snapshot_taken_before_keeps_its_values():
    mesh = floor_map()
    before = mesh.snapshot()

    see(mesh, post(2.0, 2.0), 1.0)

    assert mesh.snapshot().version == before.version + 1
    assert not before.lethal.any()
    assert np.isfinite(before.edge_weights).all()


def test_edge_weights_follow_costs_and_block_lethal_ends():
    mesh = floor_map()
    see(mesh, post(2.05, 2.02), 1.0)
    snapshot = mesh.snapshot()

    for vertex in range(len(mesh.vertices)):
        for entry in range(*mesh.neighbour_offsets[vertex : vertex + 2]):
            other, length = mesh.neighbours[entry], mesh.neighbour_lengths[entry]
            if snapshot.lethal[vertex] or snapshot.lethal[other]:
                assert snapshot.edge_weights[entry] == np.inf
            else:
                mean = (snapshot.costs[vertex] + snapshot.costs[other]) / 2
                assert snapshot.edge_weights[entry] == pytest.approx(length * (1 + 2.0 * mean), rel=1e-5)


def test_points_of_the_ground_and_above_the_robot_mark_nothing():
    mesh = floor_map(robot_height=1.0, ground_tolerance=0.05)
    version = mesh.snapshot().version

    see(mesh, [[1.0, 1.0, 0.03], [1.0, 1.0, -0.04], [2.0, 2.0, 1.2], [np.nan, 0.0, 0.0]], 1.0)

    assert not mesh.layers["seen"].lethal.any()
    assert mesh.snapshot().version == version


def test_obstacle_stays_on_its_storey():
    mesh = floor_map(storeys=2)

    see(mesh, post(2.0, 2.0, low=2.6, high=3.3), 1.0, [0.0, 2.0, 3.0])

    assert set(mesh.vertices[mesh.layers["seen"].lethal][:, 2]) == {2.5}


def test_points_beyond_the_range_limit_are_ignored():
    mesh = floor_map(obstacle_max_range=1.5)

    see(mesh, np.vstack([post(1.0, 2.0), post(3.0, 2.0)]), 1.0)

    assert (mesh.vertices[mesh.layers["seen"].lethal][:, 0] < 1.5).all()
    assert mesh.layers["seen"].lethal.any()


def test_points_at_the_sensor_itself_mark_nothing_and_keep_nothing_from_being_cleared():
    mesh = floor_map(decay_time=5.0)
    see(mesh, nothing := np.tile(SENSOR, (20, 1)), 1.0)
    assert not mesh.snapshot().lethal.any()

    hit, origin = np.array([[2.0, 2.0, 0.5]]), np.array(SENSOR)
    see(mesh, hit, 2.0)
    see(mesh, np.vstack([nothing, origin + 2.0 * (hit - origin)]), 3.0)
    assert mesh.vertices[mesh.layers["seen"].lethal][:, 0].min() > 3.5


def test_points_of_the_robot_itself_are_ignored_up_to_the_least_distance():
    mesh = floor_map(obstacle_min_range=0.5)
    see(mesh, np.vstack([post(0.4, 2.0, 0.4, 0.6), post(2.0, 2.0, 0.4, 0.6)]), 1.0)
    assert mesh.vertices[mesh.layers["seen"].lethal][:, 0].min() > 1.5


def test_without_decay_only_the_newest_cloud_counts():
    mesh = floor_map()
    see(mesh, post(1.0, 1.0), 1.0)

    see(mesh, post(3.0, 3.0), 2.0)

    assert (mesh.vertices[mesh.layers["seen"].lethal][:, 0] > 2.0).all()


def test_hits_are_kept_for_the_decay_time():
    mesh = floor_map(decay_time=2.0)
    see(mesh, post(1.0, 1.0), 1.0)
    see(mesh, post(3.0, 3.0), 2.0)
    assert len(np.unique(np.round(mesh.vertices[mesh.layers["seen"].lethal][:, 0]))) == 2

    mesh.update(None, 3.5)

    assert (mesh.vertices[mesh.layers["seen"].lethal][:, 0] > 2.0).all()
    mesh.update(None, 4.5)
    assert not mesh.snapshot().lethal.any()


@pytest.mark.parametrize(("clearing", "left"), [(True, False), (False, True)])
def test_kept_hit_is_cleared_when_rays_pass_through_it(clearing, left):
    mesh = floor_map(decay_time=np.inf, clearing=clearing)
    see(mesh, post(1.0, 2.0, 0.45, 0.55), 1.0)
    wall_y, wall_z = np.meshgrid(np.linspace(1.0, 3.0, 60), np.linspace(0.2, 0.8, 60))
    wall = np.column_stack([np.full(3600, 3.0), wall_y.ravel(), wall_z.ravel()])

    see(mesh, wall, 2.0)

    seen = mesh.vertices[mesh.layers["seen"].lethal]
    assert bool((seen[:, 0] < 2.0).any()) is left
    assert (seen[:, 0] > 2.5).any()


def test_ray_that_ends_on_the_hit_does_not_clear_it():
    image = RangeImage(np.array([[2.0, 0.0, 0.0]]), np.zeros(3))

    seen = image.sees_through(np.array([[1.0, 0.0, 0.0], [1.95, 0.0, 0.0], [0.0, 1.0, 0.0]]))

    assert seen.tolist() == [True, False, False]


def test_clear_forgets_everything_and_frees_the_edges():
    mesh = floor_map(decay_time=np.inf)
    free = mesh.snapshot()
    see(mesh, post(2.0, 2.0), 1.0)

    mesh.clear()

    np.testing.assert_array_equal(mesh.snapshot().edge_weights, free.edge_weights)
    np.testing.assert_array_equal(mesh.snapshot().costs, free.costs)


def test_points_are_projected_along_the_configured_axis():
    slanted = floor_map(down_axis=(1.0, 0.0, -1.0), robot_height=2.0)

    see(slanted, [[2.0, 2.0, 0.6]], 1.0)

    np.testing.assert_allclose(slanted.vertices[slanted.layers["seen"].lethal][:, 0].mean(), 2.6, atol=0.2)
    with pytest.raises(LayerListError, match="an axis that has a direction"):
        floor_map(down_axis=(0.0, 0.0, 0.0))


def test_map_is_stale_when_no_cloud_came_within_the_expected_rate():
    mesh = floor_map(expected_update_rate=0.5)

    assert mesh.stale_reason(0.0)
    see(mesh, np.zeros((0, 3)), 10.0)
    assert not mesh.stale_reason(10.4)
    assert mesh.stale_reason(10.6)
    assert not floor_map(expected_update_rate=0.0).stale_reason(1e9)
    assert floor_map().stale_reason(1e9), "a silent sensor is noticed by default"


def test_a_cleared_map_is_not_current_before_it_sees_again():
    mesh = floor_map()
    see(mesh, post(2.0, 2.0), 10.0)
    assert not mesh.stale_reason(10.1)

    mesh.clear()

    assert mesh.stale_reason(10.1)
    see(mesh, post(2.0, 2.0), 10.2)
    assert not mesh.stale_reason(10.2)


def test_changed_robot_height_applies_to_the_next_cloud():
    mesh = floor_map(robot_height=0.3)
    see(mesh, post(2.0, 2.0, 0.5, 0.9), 1.0)
    assert not mesh.snapshot().lethal.any()

    layer = mesh.layers["seen"]
    mesh.set_layer_parameters("seen", layer.parameters.model_copy(update={"robot_height": 1.0}))
    see(mesh, post(2.0, 2.0, 0.5, 0.9), 2.0)

    assert mesh.snapshot().lethal.any()


def test_changed_inflation_radius_reaches_the_snapshot():
    mesh = floor_map()
    see(mesh, post(2.0, 2.0), 1.0)
    reach = (mesh.snapshot().costs > 0).sum()

    layer = mesh.layers["inflation"]
    mesh.set_layer_parameters("inflation", layer.parameters.model_copy(update={"inflation_radius": 1.0}))

    assert (mesh.snapshot().costs > 0).sum() > reach


def test_parameters_a_layer_cannot_take_leave_it_as_it_was():
    mesh = floor_map()
    see(mesh, post(2.0, 2.0), 1.0)
    before, layer = mesh.snapshot(), mesh.layers["inflation"]

    with pytest.raises(TypeError, match="layer 'inflation' takes InflationParameters, got ObstacleParameters"):
        mesh.set_layer_parameters("inflation", mesh.layers["seen"].parameters, until=5.0)

    assert mesh.snapshot() is before and mesh.usual_parameters("inflation") is layer.parameters
    see(mesh, post(3.0, 3.0), 2.0)
    assert (mesh.snapshot().costs > 0).any()


@pytest.mark.parametrize("factor", [np.nan, np.inf, -1.0])
def test_an_edge_cost_factor_that_is_none_is_refused(factor):
    with pytest.raises(ValueError, match="edge_cost_factor"):
        floor_map().set_edge_cost_factor(factor)


def test_changed_edge_cost_factor_changes_the_weights():
    mesh = floor_map()
    see(mesh, post(2.0, 2.0), 1.0)

    mesh.set_edge_cost_factor(0.0)

    finite = np.isfinite(mesh.snapshot().edge_weights)
    np.testing.assert_array_equal(mesh.snapshot().edge_weights[finite], mesh.neighbour_lengths[finite])
    assert not finite.all()
