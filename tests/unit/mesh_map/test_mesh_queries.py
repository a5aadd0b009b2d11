"""Points, poses and paths on a floor with one wall of lethal vertices at x = 2, and a storey above it."""

import math
from contextlib import nullcontext

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.map_queries import MapQueries
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_mesh_nav.map.layer import MeshLayer
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh


class StandingRobot:
    """A robot that stands at one pose."""

    def __init__(self, pose: Pose) -> None:
        self._pose = pose

    def pose(self) -> Pose:
        return self._pose


@pytest.fixture(scope="module")
def walled_map() -> MeshMap:
    vertices, faces = heightfield_mesh(np.zeros((21, 41)), 0.1, 0.1)
    storeys = np.vstack([vertices, vertices + np.array([0.0, 0.0, 2.5])])
    wall = {"polygon": ((1.95, -1.0), (2.05, -1.0), (2.05, 3.0), (1.95, 3.0)), "z_max": 1.0}
    parameters = MeshMapParameters(
        layers=[
            {"name": "wall", "type": "keepout"},
            {"name": "lawn", "type": "label"},
            {"name": "sum", "type": "weighted_sum", "inputs": ["wall", "lawn"]},
        ],
        inscribed_radius=0.25,
    )
    blocks = {"wall": {"regions": [wall]}, "lawn": {"default_cost": 0.5}}
    return build_mesh_map(parameters, blocks, vertices=storeys, faces=np.vstack([faces, faces + len(vertices)]))


class Served:
    """A mesh map that nobody updates."""

    def __init__(self, mesh_map: MeshMap) -> None:
        self.map = mesh_map

    def in_use(self):
        return nullcontext()

    def update(self) -> None:
        self.map.update(None, 0.0)


def ask(mesh_map: MeshMap, robot: Pose) -> MapQueries:
    return MapQueries(Served(mesh_map), Served(mesh_map), StandingRobot(robot), TransformBuffer())


@pytest.fixture
def queries(walled_map: MeshMap) -> MapQueries:
    return ask(walled_map, Pose.planar(1.0, 1.0))


@pytest.mark.parametrize(
    ("x", "z", "state"),
    [
        (1.0, 0.0, CellState.FREE),
        (1.82, 0.1, CellState.INSCRIBED),
        (2.01, 0.0, CellState.LETHAL),
        (2.01, 2.5, CellState.FREE),
        (2.01, 1.2, CellState.OUTSIDE),
        (9.0, 0.0, CellState.OUTSIDE),
    ],
)
def test_state_of_a_point_depends_on_the_wall_and_the_storey(queries: MapQueries, x: float, z: float, state: CellState):
    assert queries.check_point(Pose.planar(x, 1.0, z=z)).state == state


def test_cost_of_a_point_is_interpolated(queries: MapQueries):
    assert queries.check_point(Pose.planar(1.03, 1.07)).cost == pytest.approx(0.5)
    assert queries.check_point(Pose.planar(1.95, 1.0)).cost == pytest.approx(1.0)


def test_robot_fits_until_its_disc_touches_the_wall(queries: MapQueries):
    assert queries.check_pose(Pose.planar(1.4, 1.0)).state == CellState.FREE
    assert queries.check_pose(Pose.planar(1.5, 1.0)).state == CellState.INSCRIBED
    assert queries.check_pose(Pose.planar(1.42, 1.0), PlaceQuery(safety_dist=0.1)).state == CellState.INSCRIBED
    assert queries.check_pose(Pose.planar(1.7, 1.0)).state == CellState.INSCRIBED
    assert queries.check_pose(Pose.planar(1.8, 1.0)).state == CellState.LETHAL
    assert queries.check_pose(Pose.planar(1.7, 1.0), PlaceQuery(safety_dist=0.1)).state == CellState.LETHAL


def test_cost_of_a_pose_sums_the_vertices_below_it_with_multipliers(queries: MapQueries):
    below = sum(np.hypot(i, j) <= 2.5 for i in range(-3, 4) for j in range(-3, 4))

    assert queries.check_pose(Pose.planar(1.0, 1.0)).cost == pytest.approx(0.5 * below)
    plain = queries.check_pose(Pose.planar(2.0, 1.0)).cost
    assert queries.check_pose(Pose.planar(2.0, 1.0), PlaceQuery(lethal_cost_mult=2.0)).cost > plain


def test_pose_of_the_robot_is_taken_without_a_pose(queries: MapQueries):
    assert queries.check_pose(None) == queries.check_pose(Pose.planar(1.0, 1.0))


def test_path_is_checked_pose_by_pose_up_to_the_wanted_state(queries: MapQueries):
    path = Path.from_poses([Pose.planar(x, 1.0) for x in np.arange(1.0, 3.01, 0.2)])

    whole = queries.check_path(path)
    stopped = queries.check_path(path, return_on=CellState.LETHAL)
    centre_line = queries.check_path(path, return_on=CellState.LETHAL, path_cells_only=True)

    assert (whole.last_checked, whole.state) == (10, CellState.LETHAL)
    assert stopped.last_checked == 4
    assert centre_line.last_checked == 5
    assert queries.check_path(path, skip_poses=9).last_checked == 10
    assert queries.check_path(path, skip_poses=9).state == CellState.FREE


def test_nearest_valid_pose_is_beside_the_wall_on_the_same_storey(queries: MapQueries):
    wanted = Pose.planar(1.9, 1.0, yaw=0.3)

    found = queries.find_valid_pose(wanted, 0.5, 0.0)

    assert found.state == CellState.INSCRIBED
    assert found.pose is not None
    assert found.pose.position == pytest.approx((1.7, 1.0, 0.0))
    assert found.pose.orientation == wanted.orientation


def test_pose_that_fits_is_returned_as_it_is_and_none_where_nothing_fits(queries: MapQueries):
    wanted = Pose.planar(1.033, 1.0)

    assert queries.find_valid_pose(wanted, 0.5, 0.0).pose == wanted
    blocked = queries.find_valid_pose(Pose.planar(2.0, 1.0), 0.1, 0.0)
    assert (blocked.state, blocked.pose) == (CellState.LETHAL, None)
    assert queries.find_valid_pose(Pose.planar(9.0, 1.0), 0.1, 0.0).state == CellState.OUTSIDE


class PartlyUnknownGround(MeshLayer):
    """A layer that has no number for the surroundings of (1, 1)."""

    def compute(self) -> tuple[np.ndarray, np.ndarray]:
        near = np.linalg.norm(self.topology.vertices - [1.0, 1.0, 0.0], axis=1) < 0.15
        return np.where(near, np.nan, 0.0).astype(np.float32), np.zeros(len(near), dtype=np.bool_)


def test_ground_of_unknown_cost_is_no_place_for_a_robot():
    vertices, faces = heightfield_mesh(np.zeros((21, 21)), 0.1, 0.1)
    parameters = MeshMapParameters(layers=[{"name": "partly", "type": "partly"}], inscribed_radius=0.25)
    mesh = build_mesh_map(parameters, vertices=vertices, faces=faces, load_layer=lambda _: PartlyUnknownGround)
    queries = ask(mesh, Pose.planar(0.5, 0.5))

    assert queries.check_point(Pose.planar(1.0, 1.0)).state == CellState.LETHAL
    assert queries.check_pose(Pose.planar(1.2, 1.0)).state == CellState.LETHAL
    found = queries.find_valid_pose(Pose.planar(1.0, 1.0), 1.0, 0.0)
    assert found.pose is not None and np.hypot(found.pose.x - 1.0, found.pose.y - 1.0) > 0.3


@pytest.mark.parametrize("skipped", [-1, -2])
def test_a_path_of_which_less_than_no_pose_is_skipped_is_misuse(queries: MapQueries, skipped: int):
    with pytest.raises(ValueError, match=f"skip_poses must not be negative, got {skipped}"):
        queries.check_path(Path.from_poses([Pose.planar(1.0, 1.0), Pose.planar(2.0, 1.0)]), skip_poses=skipped)


@pytest.mark.parametrize("tolerance", [-0.1, float("nan")])
def test_a_tolerance_that_is_negative_or_no_number_is_misuse(queries: MapQueries, tolerance: float):
    with pytest.raises(ValueError, match="tolerances must not be negative"):
        queries.find_valid_pose(Pose.planar(2.0, 1.0), tolerance, 0.0)


def test_a_tolerance_beyond_all_use_is_named_and_inf_means_anywhere(queries: MapQueries):
    with pytest.raises(ValueError, match=r"dist_tolerance must be at most 1000 m \(inf = anywhere\), got 1e\+30"):
        queries.find_valid_pose(Pose.planar(2.0, 1.0), 1e30, 0.0)
    assert queries.find_valid_pose(Pose.planar(2.0, 1.0), math.inf, math.inf).pose is not None


def test_between_vertices_where_the_robot_touches_nothing_it_touches_nothing():
    """A post lies 0.305 m from both ends of an edge and 0.28 m from its middle; the robot's radius is 0.3 m."""
    corners = np.array([(-0.12, 0.0, 0.0), (0.12, 0.0, 0.0), (0.0, 0.28, 0.0), (0.0, -0.28, 0.0)])
    post = {"polygon": ((-0.01, 0.27), (0.01, 0.27), (0.01, 0.29), (-0.01, 0.29))}
    parameters = MeshMapParameters(layers=[{"name": "post", "type": "keepout"}], inscribed_radius=0.3)
    faces = [(0, 1, 2), (1, 0, 3)]
    there = build_mesh_map(parameters, {"post": {"regions": [post]}}, vertices=corners, faces=faces)
    check = there.pose_check(PlaceQuery())
    states = [check(Pose.planar(0.0, y)).state for y in (0.0, -0.02, 0.02)]
    assert states == [CellState.INSCRIBED, CellState.INSCRIBED, CellState.LETHAL]
    assert there.pose_check(PlaceQuery(safety_dist=0.01))(Pose.planar(0.0, 0.0)).state is CellState.LETHAL


@pytest.mark.parametrize(("own", "layers", "free_to"), [(0.0, 0.1, 1.8), (0.0, 0.25, 1.6), (0.25, 0.1, 1.6)])
def test_a_robot_of_unknown_radius_looks_ahead_as_far_as_its_layers_say_it_reaches(own, layers, free_to):
    vertices, faces = heightfield_mesh(np.zeros((21, 41)), 0.1, 0.1)
    parameters = MeshMapParameters(
        layers=[{"name": "wall", "type": "keepout"}, {"name": "inflation", "type": "inflation", "inputs": ["wall"]}],
        inscribed_radius=own,
    )
    wall = {"polygon": ((1.95, -1.0), (4.0, -1.0), (4.0, 3.0), (1.95, 3.0))}
    radii = {"inscribed_radius": layers, "inflation_radius": 0.4, "inscribed_value": 0.5}
    blocks = {"wall": {"regions": [wall]}, "inflation": radii}
    mesh_map = build_mesh_map(parameters, blocks, vertices=vertices, faces=faces)
    free = [x for x in (1.5, 1.6, 1.7, 1.8) if not mesh_map.obstacle_ahead(Pose.planar(x, 1.0), Twist.planar(0.1), 0.1)]
    assert free[-1] == free_to
