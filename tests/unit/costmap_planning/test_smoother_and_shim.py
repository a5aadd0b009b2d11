"""The path smoother and the rotation shim."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from scipy import ndimage

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.registry import PluginError
from mbf_abstract.geometry import Path, Pose, Twist, quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.map_queries import check_path
from mbf_abstract.maps.queries import AS_CONFIGURED, PADDED
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_abstract.server.factory import read_config
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.control.path_geometry import resample
from mbf_costmap_nav.controllers.rotation_shim import RotationShimController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.map.line_cells import cost_along
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.planners.astar import AStarPlanner
from mbf_costmap_nav.refiners.smoother import SmootherRefiner, curvatures

CORNER = Path.from_points([(1, 1, 0), (4, 1, 0), (4, 4, 0)], final_orientation=Pose.planar(0, 0, 0.5).orientation)
FREE = Costmap(np.zeros((120, 120), dtype=np.uint8), 0.05)


def smooth(plugin, path, token=None):
    return plugin.apply_refinement(path, token or CancelToken())


def test_a_corner_is_rounded_and_the_ends_stay(make_plugin):
    result = smooth(make_plugin(SmootherRefiner, FREE), CORNER)
    assert result.success and result.path.length < CORNER.length
    assert result.path[0].position == CORNER[0].position
    last = len(result.path) - 1
    assert result.path[last].position == CORNER[2].position and result.path[last].yaw == pytest.approx(0.5)


def test_the_curvature_limit_is_kept(make_plugin):
    loose = smooth(make_plugin(SmootherRefiner, FREE), CORNER)
    strict = smooth(make_plugin(SmootherRefiner, FREE, max_curvature=1.0), CORNER)
    assert curvatures(loose.path.positions[:, :2]).max() > 1.0
    assert curvatures(strict.path.positions[:, :2]).max() <= 1.0


def test_a_curvature_that_cannot_be_reached_is_a_failure_that_says_where(make_plugin):
    result = smooth(make_plugin(SmootherRefiner, FREE, max_curvature=0.01), CORNER)
    assert result.outcome == RefinePathOutcome.FAILURE and "curvature" in result.message
    assert result.path is CORNER


def test_the_smoothed_path_keeps_off_obstacles(make_plugin, room):
    plan = make_plugin(AStarPlanner, room).make_plan(PlanRequest(Pose.planar(1, 1), Pose.planar(7, 1)))
    result = smooth(make_plugin(SmootherRefiner, room), plan.path)
    before = max(room.cost_at(*p[:2]) for p in plan.path.positions.tolist())
    after = max(room.cost_at(*p[:2]) for p in result.path.positions.tolist())
    assert result.success and after <= max(before, 50)
    assert np.sum(np.abs(np.diff(curvatures(result.path.positions[:, :2])))) < np.sum(
        np.abs(np.diff(curvatures(plan.path.positions[:, :2])))
    )


def walls_inflated(cells, cost_scaling_factor=3.0, **parameters):
    """A costmap of 0.05 m with walls and costs that fall as slowly as Nav2's do by default."""
    layers = ({"name": "walls", "type": "static"}, {"name": "inflation", "type": "inflation"})
    section = CostmapParameters(resolution=0.05, layers=layers, **parameters)
    inflation = {"inflation_radius": 1.0, "cost_scaling_factor": cost_scaling_factor}
    costmap = build_layered_costmap(section, {"inflation": inflation}, static_map=Costmap(cells, 0.05))
    costmap.update(None, 0.0)
    return costmap


@pytest.mark.parametrize("max_curvature", [0.0, 0.8])
def test_where_costs_are_high_the_smoothed_path_comes_no_more_than_a_cell_nearer_to_obstacles(
    make_plugin, max_curvature
):
    cells = np.zeros((120, 120), dtype=np.uint8)
    cells[32:, :68] = 254  # on the inner side of the corner, 0.6 m from the path
    costmap = walls_inflated(cells, robot_radius=0.2)
    room = costmap.snapshot()
    smoother = make_plugin(SmootherRefiner, FREE, costmap=costmap, max_curvature=max_curvature, data_weight=0.02)
    path = smooth(smoother, CORNER).path
    near = ndimage.maximum_filter(np.minimum(room.cells, 252), 3)
    planned = resample(CORNER.positions[:, :2], 0.01)
    for place in resample(path.positions[:, :2], 0.02):
        around, _ = room.world_to_cells(planned[np.hypot(*(planned - place).T) < 0.6])
        assert room.cost_at(*place.tolist()) <= max(50, near[around[:, 1], around[:, 0]].max())


LONG_ROBOT = ((0.6, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.6, -0.2))
"""Its origin is over the rear axle."""


@pytest.mark.parametrize("data_weight", [0.005, 0.1])
@pytest.mark.parametrize("gap", [0.3, 0.45, 0.6])
def test_the_outline_is_on_no_worse_cells_than_before(make_plugin, gap, data_weight):
    cells = np.zeros((120, 120), dtype=np.uint8)
    cells[round((1.0 + gap) / 0.05) :, : round((4.0 - gap) / 0.05)] = 254  # on the inner side of the corner
    costmap = walls_inflated(cells, cost_scaling_factor=20.0, footprint=LONG_ROBOT)
    smoother = make_plugin(SmootherRefiner, FREE, costmap=costmap, data_weight=data_weight)
    planned = Path.from_points(np.column_stack([resample(CORNER.positions[:, :2], 0.1), np.zeros(61)]))
    path = smooth(smoother, planned).path
    assert path.length < planned.length or gap == 0.3 or data_weight == 0.005
    for query in (AS_CONFIGURED, PADDED):
        before, after = (check_path(costmap.pose_check(query), one) for one in (planned, path))
        assert after.state <= before.state


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_smoothed_line_crosses_a_lethal_cell_even_without_inflation(make_plugin, seed):
    cells = np.where(np.random.default_rng(seed).random((40, 40)) < 0.2, 254, 0).astype(np.uint8)
    cells[1:3, 1:3] = cells[37:39, 37:39] = 0
    grid = Costmap(cells, 0.05)
    planner = make_plugin(AStarPlanner, grid, footprint=Footprint([]))
    plan = planner.make_plan(PlanRequest(Pose.planar(0.1, 0.1), Pose.planar(1.9, 1.9)))
    assume(plan.success)
    smoothed = smooth(make_plugin(SmootherRefiner, grid), plan.path).path
    along = resample(smoothed.positions[:, :2], 0.001)
    assert max(grid.cost_at(x, y) for x, y in along.tolist()) < 254


def highest_cost_of_cells_cut(cells, line, slack):
    """The slow way: clip the line to each square, made wider by ``slack``; out of the grid all squares are lethal."""
    x0, y0, x1, y1 = line
    highest = 0
    for iy, ix in np.ndindex(14, 14):
        start, stop = 0.0, 1.0
        for begin, end, low in ((x0, x1, ix - 2), (y0, y1, iy - 2)):
            low, high = low - slack, low + 1 + slack
            if begin == end:
                start, stop = (start, stop) if low < begin < high else (1.0, 0.0)
            else:
                first, last = sorted(((low - begin) / (end - begin), (high - begin) / (end - begin)))
                start, stop = max(start, first), min(stop, last)
        if start < stop:
            inside = 2 <= ix < 12 and 2 <= iy < 12
            highest = max(highest, int(cells[iy - 2, ix - 2]) if inside else 254)
    return highest


@given(st.tuples(*[st.floats(-1.0, 11.0)] * 4), st.integers(0, 2**32 - 1))
@settings(max_examples=100, deadline=None)
def test_the_cost_along_a_line_is_the_highest_of_the_cells_it_cuts(line, seed):
    cells = np.random.default_rng(seed).integers(0, 254, (10, 10)).astype(np.uint8)
    highest = cost_along(cells, 0, *line)
    assert highest_cost_of_cells_cut(cells, line, -1e-6) <= highest <= highest_cost_of_cells_cut(cells, line, 1e-6)


def test_a_cancelled_refinement_says_so(make_plugin):
    token = CancelToken()
    token.cancel()
    assert smooth(make_plugin(SmootherRefiner, FREE), CORNER, token).outcome == RefinePathOutcome.CANCELED


def test_a_path_with_reversing_is_left_alone(make_plugin):
    positions = np.array([[1, 1, 0], [2, 1, 0], [3, 1, 0], [2, 1, 0], [1, 1, 0]], dtype=float)
    path = Path(positions)
    assert smooth(make_plugin(SmootherRefiner, FREE), path).path is path


def test_the_smoothed_path_keeps_its_heights(make_plugin):
    path = Path.from_points([(1, 1, 5.0), (3, 1, 5.0), (3, 4, 6.5)])
    heights = smooth(make_plugin(SmootherRefiner, FREE), path).path.positions[:, 2]
    assert (heights[0], heights[-1]) == (5.0, 6.5)
    assert heights.min() == 5.0 and (np.diff(heights) >= 0.0).all() and 0.0 < np.diff(heights).max() < 0.06


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.0), (100.0, -3.0, 0.0)])
def test_a_path_in_another_frame_is_smoothed_on_the_map_and_handed_back_in_its_own(make_plugin, room, at):
    plan = make_plugin(AStarPlanner, room).make_plan(PlanRequest(Pose.planar(1, 1), Pose.planar(7, 1, 1.0)))
    T_map_far = Transform(at, quaternion_from_yaw(math.pi / 2), "map", "far", static=True)
    transforms = TransformBuffer()
    transforms.set(T_map_far)
    smoother = make_plugin(SmootherRefiner, room, transforms=transforms)
    expected, result = smooth(smoother, plan.path), smooth(smoother, T_map_far.inverse().apply_to_path(plan.path))
    assert result.success and result.path.frame_id == "far"
    back = T_map_far.apply_to_path(result.path)
    assert back.positions == pytest.approx(expected.path.positions, abs=1e-9)
    assert [p.yaw for p in back] == pytest.approx([p.yaw for p in expected.path], abs=1e-6)


def test_a_path_in_a_frame_that_nobody_knows_is_refused(make_plugin):
    path = Path.from_points([(1, 1, 0), (4, 1, 0)], frame_id="nowhere")
    result = smooth(make_plugin(SmootherRefiner, FREE), path)
    assert result.outcome == RefinePathOutcome.MAP_ERROR and "nowhere" in result.message
    assert result.path is path


def test_a_path_through_a_wall_is_a_failure_that_says_where(make_plugin):
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[:, 50] = 254
    result = smooth(make_plugin(SmootherRefiner, cells, resolution=0.1), Path.from_points([(1, 3, 0), (9, 3, 0)]))
    assert result.outcome == RefinePathOutcome.FAILURE and "lethal cell at (5.0" in result.message


def test_a_line_that_only_touches_the_corners_of_lethal_cells_is_no_failure(make_plugin):
    cells = np.zeros((10, 10), dtype=np.uint8)
    cells[3, 4] = cells[4, 3] = 254
    path = Path.from_points([(0.35, 0.35, 0), (0.45, 0.45, 0)])
    assert smooth(make_plugin(SmootherRefiner, cells, resolution=0.1), path).success


@pytest.fixture
def shim(make_plugin):
    inner = "mbf_costmap_nav.controllers.regulated_pure_pursuit:RegulatedPurePursuitController"
    return make_plugin(RotationShimController, FREE, inner_type=inner, inner={"rotate_to_heading": False})


def command_at(controller, yaw, velocity=None):
    return controller.compute_velocity_commands(ControlRequest(Pose.planar(1, 1, yaw), velocity or Twist())).command


def test_the_shim_refuses_what_its_inner_controller_refuses_and_for_no_earlier_reason(shim):
    path = Path.from_points([(1, 1, 0), (2, 1, 0)])
    shim._inner.set_plan = lambda path: shim._inner.refuse("too long")
    assert not shim.set_plan(path) and shim.refusal == "too long"
    shim._inner.set_plan = lambda path: False
    assert not shim.set_plan(path) and shim.refusal == ""


def test_the_shim_turns_first_and_then_lets_the_inner_controller_drive(shim):
    shim.set_plan(CORNER)
    assert command_at(shim, math.pi / 2).vx == 0.0 and command_at(shim, math.pi / 2).wz < 0.0
    assert command_at(shim, 0.1).vx > 0.0
    assert command_at(shim, 1.5).vx > 0.0, "aligned once, it does not interfere again on the same path"


def test_the_shim_aligns_again_for_a_new_path(shim):
    shim.set_plan(CORNER)
    command_at(shim, 0.0)
    shim.set_plan(CORNER)
    assert command_at(shim, math.pi / 2).vx == 0.0


ALONG_Y = Path.from_points([(1.0, y, 0.0) for y in np.linspace(1.0, 4.0, 61)])


def braking_shim(make_plugin, costmap, **parameters):
    """A shim, and one cycle of a robot that does as it is commanded, its path leading to its left."""
    inner = {"acc_lim_x": 0.5, "max_vel_x": 0.6}
    shim = make_plugin(RotationShimController, costmap, inner_type="regulated_pure_pursuit", inner=inner, **parameters)
    assert shim.set_plan(ALONG_Y)
    return shim


@pytest.mark.parametrize("stated", [{}, {"acc_lim_x": 0.5}], ids=["of the inner one", "its own"])
def test_the_shim_brakes_a_robot_that_rolls_before_it_turns_it(make_plugin, stated):
    shim, x, velocity, speeds = braking_shim(make_plugin, FREE, **stated), 1.0, Twist.planar(0.6), []
    for _ in range(40):
        command = shim.compute_velocity_commands(ControlRequest(Pose.planar(x, 1.0), velocity)).command
        assert (
            command.vx == pytest.approx(max(velocity.vx - 0.025, 0.0)) and abs(command.wz - velocity.wz) <= 0.16 + 1e-9
        )
        assert command.wz == 0.0 or command.vx <= 0.1 + 1e-9
        velocity, x = command, x + 0.05 * command.vx
        speeds.append(command.vx)
    assert speeds[-1] == 0.0 and velocity.wz > 1.0


def test_the_shim_leaves_a_robot_that_rolls_to_the_inner_controller_where_it_would_brake_into_something(make_plugin):
    cells = np.zeros((100, 100), dtype=np.uint8)
    cells[:, 32:] = 254  # 0.4 m ahead of the outline
    beside_wall = braking_shim(make_plugin, Costmap(cells, 0.05))
    rolling = ControlRequest(Pose.planar(1.0, 1.0), Twist.planar(0.8))
    assert beside_wall.compute_velocity_commands(rolling).message != "turning to the path"
    assert braking_shim(make_plugin, FREE).compute_velocity_commands(rolling).message == "turning to the path"


def test_the_shim_does_not_turn_to_what_lies_behind_a_change_of_gears(shim):
    xs = [3.0, 3.1, *np.arange(3.05, 2.0, -0.05)]  # forward 0.1 m, then back
    shim.set_plan(Path.from_poses([Pose.planar(float(x), 1.0, 0.0) for x in xs]))
    command = shim.compute_velocity_commands(ControlRequest(Pose.planar(3.0, 1.0, 0.0), Twist())).command
    assert command.vx > 0.0 and command.wz == 0.0


def test_where_its_turn_is_blocked_the_shim_leaves_the_path_to_the_inner_controller(make_plugin):
    cells = np.zeros((120, 120), dtype=np.uint8)
    cells[64, 69] = 254  # beside the left front corner of a robot of 1.0 m x 0.4 m
    long_robot = Footprint([(0.5, 0.2), (-0.5, 0.2), (-0.5, -0.2), (0.5, -0.2)])
    shim = make_plugin(RotationShimController, Costmap(cells, 0.05), footprint=long_robot)
    shim.set_plan(Path.from_points([(3, 3, 0), (3, 5, 0)]))
    for turning in (0.0, -0.127):  # the inner one turns to the other side; back from there the shim would turn again
        request = ControlRequest(Pose.planar(3.0, 2.98, 0.0), Twist.planar(wz=turning))
        assert shim.compute_velocity_commands(request).message != "turning to the path"
    shim.set_plan(Path.from_points([(3, 3, 0), (3, 1, 0)]))
    assert shim.compute_velocity_commands(request).message == "turning to the path"


def test_the_shim_refuses_unknown_parameters_of_the_inner_controller(make_plugin):
    with pytest.raises(ValueError, match="no_such"):
        make_plugin(RotationShimController, FREE, inner={"no_such": 1})


SHIM_CONFIG = """\
backend: costmap
controllers:
  - {name: shim, type: rotation_shim}
global_costmap: {}
local_costmap: {}
"""


def findings_of(tmp_path, text):
    """Line, key and text of all findings of a configuration."""
    file = tmp_path / "nav.yaml"
    file.write_text(SHIM_CONFIG + text)
    try:
        read_config(file)
    except ConfigError as error:
        return [(finding.line, finding.key, finding.text) for finding in error.findings]
    return []


@pytest.mark.parametrize("name", ["dwa", "costmap.dwa", "mbf_costmap_nav.controllers.dwa:DWAController"])
def test_the_shim_takes_every_type_that_the_list_of_controllers_takes(make_plugin, tmp_path, name):
    assert findings_of(tmp_path, f'shim:\n  inner_type: "{name}"\n  inner: {{max_vel_x: 0.3}}\n') == []
    shim = make_plugin(RotationShimController, FREE, inner_type=name, inner={"max_vel_x": 0.3})
    shim.set_plan(CORNER)
    assert 0.0 < command_at(shim, 0.0).vx <= 0.3


@pytest.mark.parametrize(
    ("inner_type", "text"),
    [
        ("mbf_costmap_nav.planners.astar:AStarPlanner", "is no AbstractController"),
        ("mbf_costmap_nav.controllers.mppi:Nope", "import failed"),
        ("mpi", "did you mean 'mppi'"),
    ],
)
def test_an_inner_type_that_is_no_controller_is_a_finding_with_its_line(make_plugin, tmp_path, inner_type, text):
    ((line, key, message),) = findings_of(
        tmp_path, f'shim:\n  rotate_to_heading_vel: 1.0\n  inner_type: "{inner_type}"\n'
    )
    assert (line, key) == (8, "shim.inner_type") and text in message
    with pytest.raises(PluginError, match=text):
        make_plugin(RotationShimController, FREE, inner_type=inner_type)


def test_the_inner_block_is_checked_like_any_other(tmp_path):
    ((line, key, message),) = findings_of(tmp_path, "shim:\n  inner:\n    max_vel_xx: 1.0\n")
    assert (line, key) == (8, "shim.inner.max_vel_xx") and "did you mean 'max_vel_x'" in message
    nested = "shim:\n  inner_type: rotation_shim\n  inner: {inner_type: dwa, inner: {max_vel_x: -1.0}}\n"
    assert [key for _, key, _ in findings_of(tmp_path, nested)] == ["shim.inner.inner.max_vel_x"]


def test_the_shim_does_not_evade_the_refusal_of_module_types(tmp_path):
    name = "mbf_costmap_nav.controllers.dwa:DWAController"
    text = f'shim:\n  inner_type: "{name}"\nallow_module_types: false\n'
    ((line, key, message),) = findings_of(tmp_path, text)
    assert (line, key) == (7, "shim.inner_type") and "switched off" in message
    assert findings_of(tmp_path, "allow_module_types: false\n") == []
