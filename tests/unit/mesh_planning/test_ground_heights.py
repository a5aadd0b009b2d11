"""Heights of the ground at a place seen from above: holes, storeys, ceilings, and what planners say about them."""

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.map.ground import ground_heights
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.planners.astar import AStarPlanner


def storeys(*heights, blocked_below=-np.inf):
    """Floors of 3 m x 3 m at some heights, those below a height with lethal vertices."""
    floor, faces = heightfield_mesh(np.zeros((16, 16)), 0.2, 0.2)
    floors = [floor + np.array([0.0, 0.0, height]) for height in heights]
    everywhere = ((-1.0, -1.0), (4.0, -1.0), (4.0, 4.0), (-1.0, 4.0))
    parameters = MeshMapParameters(layers=[{"name": "closed", "type": "keepout"}])
    blocks = {"closed": {"regions": [{"polygon": everywhere, "z_max": blocked_below}]}}
    joined = np.vstack([faces + index * len(floor) for index in range(len(heights))])
    return build_mesh_map(parameters, blocks, vertices=np.vstack(floors), faces=joined)


def test_a_ray_through_a_hole_hits_nothing_at_any_distance():
    heights = np.zeros((11, 11))
    heights[4:7, 4:7] = np.nan
    mesh_map = MeshMap.from_heights(heights, 0.2, 0.2)
    faces, distances = mesh_map.locator.cast_rays([[1.0, 1.0, 5.0], [0.1, 0.2, 5.0]], [0.0, 0.0, -1.0])
    assert faces[0] == -1 and np.isinf(distances[0])
    assert faces[1] >= 0 and distances[1] == pytest.approx(5.0)
    assert ground_heights(mesh_map, 1.0, 1.0) == ()
    assert ground_heights(mesh_map, 90.0, 1.0) == ()


def test_heights_come_from_the_lowest_storey_up():
    assert ground_heights(storeys(3.0, 0.0, 6.0), 1.11, 1.27) == pytest.approx((0.0, 3.0, 6.0))


def test_a_free_storey_comes_before_a_blocked_one_below_it():
    assert ground_heights(storeys(0.0, 3.0, 6.0, blocked_below=2.0), 1.11, 1.27) == pytest.approx((3.0, 6.0, 0.0))


def test_the_underside_of_a_slab_is_no_ground():
    floor, faces = heightfield_mesh(np.zeros((16, 16)), 0.2, 0.2)
    slab = np.vstack([floor, floor - np.array([0.0, 0.0, 0.3])])
    mesh_map = MeshMap.from_arrays(slab, np.vstack([faces, faces[:, ::-1] + len(floor)]))
    assert ground_heights(mesh_map, 1.11, 1.27) == pytest.approx((0.0, -0.3))


def test_seams_and_vertices_count_once():
    mesh_map = storeys(0.0, 3.0)
    assert ground_heights(mesh_map, 1.0, 1.0) == pytest.approx((0.0, 3.0))  # a vertex of six faces on each floor


def test_the_message_for_a_pose_off_the_ground_names_where_the_ground_is(make_plugin):
    planner = make_plugin(AStarPlanner, storeys(1.5, 4.5))
    result = planner.make_plan(PlanRequest(Pose.planar(1.1, 1.2), Pose.planar(2.1, 1.2, 0.0, 1.5)))
    assert result.outcome == GetPathOutcome.OUT_OF_MAP
    assert "the surface there is at z = 1.50, 4.50 m" in result.message
    result = planner.make_plan(PlanRequest(Pose.planar(1.1, 1.2, 0.0, 1.5), Pose.planar(9.0, 1.2)))
    assert "there is no surface above or below it" in result.message
