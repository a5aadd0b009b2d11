"""Facts about planning and control on grids that other packages' tests publish; the number is in the test's id."""

import json
import math

import numpy as np
import pytest
from pydantic import ValidationError

from mbf_abstract.execution.motion_watch import OscillationDetector
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_abstract.maps.map_queries import check_path
from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import ControlRequest
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.controllers.dwa import DWAController
from mbf_costmap_nav.controllers.mppi import MPPIController
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.files.map_io import load_image
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.kernels.map.rasterisation import rasterise_polygon
from mbf_costmap_nav.layers.speed_limit import SpeedLimitLayer
from mbf_costmap_nav.map.layer import LayerContext
from mbf_costmap_nav.map.pose_checks import pose_check
from mbf_costmap_nav.planners.astar import AStarPlanner
from mbf_costmap_nav.planners.dijkstra import DijkstraPlanner
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner
from tests.unit.costmap_planning.conftest import plan

PLANNERS = [AStarPlanner, DijkstraPlanner, ThetaStarPlanner]
FREE_MAP = Costmap(np.zeros((200, 200), dtype=np.uint8), 0.05, -5.0, -5.0)
SQUARE = Footprint([[2, 2], [2, -2], [-2, -2], [-2, 2]])


# ------------------------------------------------------------------------------------------- grids and footprints
def test_f064_a_cell_is_numbered_row_by_row():
    cells = np.zeros((10, 10), dtype=np.uint8)
    cells.reshape(-1)[53] = 99
    assert Costmap(cells, 1.0).cost(3, 5) == 99


@pytest.mark.parametrize(
    ("vx", "wz", "lethal"),
    [pytest.param(4.0, 0.0, (4, 8), id="F070-driving"), pytest.param(0.0, 1.0, (7, 4), id="F070-turning")],
)
def test_a_square_that_moves_into_lethal_cells_collides(vx, wz, lethal):
    cells = np.zeros((10, 10), dtype=np.uint8)
    cells[lethal[1], lethal[0]] = 254
    check = FootprintCheck(SQUARE, 1.0)
    poses = arc_poses((4.5, 4.5, math.pi / 2), vx, 0.0, wz, 1.0, 0.05)
    assert not check.collides(Costmap(cells, 1.0), 4.5, 4.5, math.pi / 2)
    assert check.first_collision(Costmap(cells, 1.0), poses) >= 0


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2], ids=["F072", "F073"])
def test_the_cells_of_a_square_have_the_published_outline(yaw):
    x0, y0, covered = rasterise_polygon(SQUARE.at(4.5, 4.5, yaw), (0, 0, 10, 10))
    cells = {(int(ix) + x0, int(iy) + y0) for iy, ix in np.argwhere(covered)}
    outline = {(x, y) for x in range(2, 7) for y in range(2, 7) if x in (2, 6) or y in (2, 6)}
    assert outline <= cells
    assert len(outline) == 20 - 4, "the published list of 20 has the four corners twice"


# ----------------------------------------------------------------------------------------------- progress of a robot
@pytest.mark.parametrize(
    ("x", "y", "turn", "after", "progress"),
    [
        pytest.param(0.01, 0.0, 0.0, 0.5, True, id="F093"),
        pytest.param(0.0, 0.0, 0.0, 2.0, False, id="F094-standing"),
        pytest.param(0.25, 0.0, 0.0, 2.0, False, id="F094-too-little"),
        pytest.param(1.0, 0.0, 0.0, 2.0, True, id="F095"),
        pytest.param(0.5 - 1e-6, 0.0, 0.0, 2.0, False, id="F096-below"),
        pytest.param(0.5 + 1e-6, 0.0, 0.0, 2.0, True, id="F096-above"),
        pytest.param(math.sqrt(0.125) + 1e-6, math.sqrt(0.125) + 1e-6, 0.0, 2.0, True, id="F096-diagonal"),
        pytest.param(0.0, 0.0, 0.25, 2.0, False, id="F097-small-turn"),
        pytest.param(0.0, 0.0, 1.0, 2.0, True, id="F097-turn"),
    ],
)
def test_progress_within_the_time_allowed(x, y, turn, after, progress):
    clock = SimClock()
    detector = OscillationDetector(clock)
    assert not detector.check(Pose.planar(0.0, 0.0), 1.0, 0.5, 0.5)
    clock.sleep(after)
    assert detector.check(Pose.planar(x, y, turn), 1.0, 0.5, 0.5) is not progress


# --------------------------------------------------------------------------------------------------------- control
def first_command(controller, velocity=0.0):
    xs = np.linspace(0.0, 4.0, 41)
    assert controller.set_plan(Path(np.column_stack([xs, 0 * xs, 0 * xs])))
    result = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist.planar(velocity)))
    assert result.success
    return result.command


def test_f104_from_rest_only_the_window_of_one_period_is_reachable(make_plugin):
    command = first_command(make_plugin(RegulatedPurePursuitController, FREE_MAP, acc_lim_x=2.5))
    assert (command.vx, command.wz) == pytest.approx((0.125, 0.0))


@pytest.fixture
def limit_speed():
    """Put a speed-limit layer with one zone over the middle of a plugin's map, or take it away."""

    def limit(plugin, percent):
        corners = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
        zone = {"name": "slow", "polygon": corners, "speed_limit": percent}
        parameters = SpeedLimitLayer.Parameters(zones=(zone,), limit_type="percent")
        plugin.costmap.layers = LayerStack([SpeedLimitLayer(LayerContext("slow", parameters, "map", False))])

    return limit


@pytest.mark.parametrize(
    ("controller_class", "full_speed"),
    [
        pytest.param(RegulatedPurePursuitController, 0.5, id="F105-pursuit"),
        pytest.param(DWAController, 0.5, id="F105-dwa"),
        pytest.param(MPPIController, 0.5, id="F105-mppi"),
    ],
)
def test_a_speed_limit_in_percent_holds_until_it_is_lifted(make_plugin, limit_speed, controller_class, full_speed):
    controller = make_plugin(controller_class, FREE_MAP)
    limit_speed(controller, 30.0)
    slow = first_command(controller, velocity=0.3 * full_speed).vx
    controller.costmap.layers = LayerStack()
    fast = first_command(controller, velocity=0.9 * full_speed).vx
    assert 0.15 * full_speed < slow <= 0.3 * full_speed + 1e-6
    assert fast > 0.3 * full_speed


# -------------------------------------------------------------------------------------------------- path geometry
@pytest.mark.parametrize(
    ("a", "b", "in_space", "in_plane"),
    [
        pytest.param((3, 2, 1), (1, 2, 3), 2.82843, 2.0, id="F124"),
        pytest.param((7, 4, 3), (17, 6, 2), 10.24695, 10.19804, id="F125"),
    ],
)
def test_distance_of_two_poses(a, b, in_space, in_plane):
    assert Pose(a).distance_to(Pose(b)) == pytest.approx(in_space, abs=1e-5)
    assert Pose.planar(*a[:2]).distance_to(Pose.planar(*b[:2])) == pytest.approx(in_plane, abs=1e-5)


def test_f126_nothing_is_left_from_the_last_of_ten_poses():
    path = Path.from_points([(2.0 * i, 0.0, 0.0) for i in range(10)])
    assert path.length == pytest.approx(18.0)
    assert path.remaining_lengths[-1] == 0.0


def test_f127_a_circle_in_steps_of_one_degree():
    angles = np.radians(np.arange(361))
    path = Path.from_points(np.column_stack([2 * np.cos(angles), 2 * np.sin(angles), 0 * angles]))
    assert path.length == pytest.approx(12.566, abs=0.1)


# -------------------------------------------------------------------------------------------------------- planning
def navfn_plan(make_plugin, shared_data, start, lethal_cost, planner_class=AStarPlanner, **more):
    pixels = (shared_data / "maps" / "navfn" / "willow_costmap.pgm").read_bytes()
    cells = np.frombuffer(pixels[-1132 * 1217 :], dtype=np.uint8).reshape(1217, 1132)
    parameters = {"cost_factor": 0.0, "lethal_cost": lethal_cost, "allow_unknown": False}
    return plan(
        make_plugin(planner_class, cells.copy(), footprint=Footprint([]), **parameters, **more),
        (start[0] + 0.5, start[1] + 0.5),
        (350.5, 450.5),
    )


def test_f157_a_way_through_willow_garage_over_inscribed_cells(make_plugin, shared_data):
    result = navfn_plan(make_plugin, shared_data, (428, 746), lethal_cost=254)
    assert result.path.length == pytest.approx(328.3087, abs=1e-3)
    assert not navfn_plan(make_plugin, shared_data, (428, 746), lethal_cost=253).success


def test_f158_a_straight_way_through_willow_garage(make_plugin, shared_data):
    result = navfn_plan(make_plugin, shared_data, (350, 400), lethal_cost=254)
    assert result.path.length == pytest.approx(50.0)


@pytest.mark.parametrize("planner_class", [AStarPlanner, DijkstraPlanner])
@pytest.mark.parametrize(
    ("start", "octile"), [pytest.param((428, 746), 328.3087, id="F157"), pytest.param((350, 400), 50.0, id="F158")]
)
def test_navfns_paths_through_willow_garage_down_its_own_potential(
    make_plugin, shared_data, planner_class, start, octile
):
    result = navfn_plan(make_plugin, shared_data, start, 254, planner_class, interpolated_potential=True)
    assert result.success and result.path.length <= octile + 1e-3


@pytest.mark.parametrize("planner_class", PLANNERS)
@pytest.mark.parametrize(
    "wrong",
    [
        pytest.param({"cost_factor": -1.0}, id="F163-weight"),
        pytest.param({"how_many_corners": 5}, id="F163-unknown"),
        pytest.param({"lethal_cost": 300}, id="F163-range"),
    ],
)
def test_parameters_out_of_range_are_refused(planner_class, wrong):
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        planner_class.Parameters(**wrong)


@pytest.mark.parametrize("planner_class", [*PLANNERS, HybridAStarPlanner], ids=lambda c: f"F166-{c.__name__}")
def test_a_start_outside_the_map_is_reported(make_plugin, planner_class):
    result = plan(make_plugin(planner_class, np.zeros((100, 100)), resolution=0.1), (-1.0, 5.0), (5.0, 5.0))
    assert result.outcome == GetPathOutcome.OUT_OF_MAP and "start" in result.message


def test_f168_forward_arcs_around_the_block_have_no_gaps(make_plugin):
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[40:61, 40:61] = 254
    planner = make_plugin(
        HybridAStarPlanner,
        cells,
        resolution=0.1,
        footprint=Footprint([]),
        allow_reversing=False,
        min_turning_radius=0.8,
    )
    result = plan(planner, (1.05, 1.05, 0.0), (8.05, 8.05, 2 * math.pi * 40 / 72))
    gaps = np.hypot(*np.diff(result.path.positions[:, :2], axis=0).T)
    assert result.success and gaps.max() < 0.21
    assert 0.8 * 63 <= result.path.length / 0.2 <= 1.2 * 63, "the published path has 63 poses up to 2.1 cells apart"


def test_f172_the_way_across_the_peers_map_in_map_order(make_plugin, shared_data):
    occupancy = load_image(shared_data / "maps" / "nav2_system_tests" / "map.pgm", resolution=1.0)
    costmap = occupancy.to_costmap()
    planner = make_plugin(AStarPlanner, costmap, cost_factor=0.0, allow_unknown=False)
    assert plan(planner, (390.5, 10.5), (10.5, 390.5)).path.length == pytest.approx(599.49, abs=0.01)


# ------------------------------------------------------------------------------------------------ validity of a path
def nav2_map(shared_data, name):
    codes = {"o": 0, "u": 100, "i": 253, "x": 254, "n": 255}
    rows = json.loads((shared_data / "maps" / "nav2_test_costmaps.json").read_text())["maps"][name]
    return Costmap(np.array([[codes[cell] for cell in row] for row in rows], dtype=np.uint8), 1.0)


def centres(cells):
    return Path.from_points([(x + 0.5, y + 0.5, 0.0) for x, y in cells])


def test_f173_of_an_empty_path_no_pose_is_checked(shared_data):
    answer = check_path(pose_check(nav2_map(shared_data, "top_left_obstacle"), Footprint([])), Path(np.zeros((0, 3))))
    assert answer.last_checked == -1


@pytest.mark.parametrize(
    ("name", "cells", "stop_at", "first_bad"),
    [
        pytest.param("top_left_obstacle", [(x, y) for y in range(1, 9) for x in range(1, 9)], "LETHAL", 9, id="F174"),
        pytest.param("top_left_obstacle", [(1, y) for y in range(1, 9)], "UNKNOWN", None, id="F175"),
        pytest.param("top_left_obstacle", [(1, y) for y in range(10)], "UNKNOWN", 0, id="F176"),
        pytest.param("open_space", [(x, 5) for x in range(10)], "INSCRIBED", None, id="F178"),
    ],
)
def test_the_first_bad_pose_of_a_path(shared_data, name, cells, stop_at, first_bad):
    stop = CellState[stop_at]
    answer = check_path(pose_check(nav2_map(shared_data, name), Footprint([])), centres(cells), return_on=stop)
    assert (answer.last_checked if answer.state >= stop else None) == first_bad


def test_f177_a_path_over_cells_with_a_cost_is_not_free_of_cost(shared_data):
    answer = check_path(pose_check(nav2_map(shared_data, "maze2"), Footprint([])), centres([(3, 2)]))
    assert answer.state is CellState.FREE and answer.cost > 0.0


def test_f179_an_unreadable_footprint_is_refused():
    with pytest.raises(ValueError, match="bad_string"):
        Footprint.parse("[[bad_string")
