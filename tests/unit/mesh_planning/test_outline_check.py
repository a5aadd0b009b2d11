"""Paths of all planners on a map that checks the footprint: a long robot fits all along them, or there is none."""

import math

import numpy as np
import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.controllers.mppi import MPPIController
from mbf_mesh_nav.controllers.path_follower import PathFollower
from mbf_mesh_nav.layers.inflation import InflationLayer
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.any_angle import AnyAnglePlanner
from mbf_mesh_nav.planners.astar import AStarPlanner
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.planners.dijkstra import DijkstraPlanner
from mbf_mesh_nav.refiners.string_pulling import StringPullingRefiner

PLANNERS = [AStarPlanner, DijkstraPlanner, AnyAnglePlanner, CVPPlanner]
LONG = ((0.5, 0.25), (-0.5, 0.25), (-0.5, -0.25), (0.5, -0.25))
EDGE, CHORD = 0.1, 0.2


@pytest.fixture
def floor(paint):
    """Factory: a level floor of 6 m x 6 m with lethal boxes (x0, x1, y0, y1), inflated for a disc of 0.25 m."""

    def make(*boxes, check_footprint=True):
        plain = MeshMap.from_heights(np.zeros((61, 61)), EDGE, EDGE)
        inside = lambda v: np.any(  # noqa: E731
            [(v[:, 0] > a) & (v[:, 0] < b) & (v[:, 1] > c) & (v[:, 1] < d) for a, b, c, d in boxes], axis=0
        )
        paint(plain, lambda v: np.where(inside(v), np.inf, 0.0))
        closed = {"lethal_value": np.inf, "inscribed_value": 1.0, "inscribed_radius": 0.25, "inflation_radius": 0.6}
        walls, common = plain.layers["painted"], (plain.topology, plain.locator)
        shown = InflationLayer(LayerContext("inflation", *common, InflationLayer.Parameters(**closed), (walls,)))
        shown.recompute()
        plain.set_layers(LayerGraph([walls, shown]), "inflation", 1.0)
        plain.inscribed_radius, plain.footprint, plain.check_footprint = 0.25, LONG, check_footprint
        return plain

    return make


GAP = ((2.95, 3.05, -0.1, 2.75), (2.95, 3.05, 3.25, 6.1))
"""A wall across the floor with a gap in it, hardly wider than the robot."""
THROUGH = PlanRequest(Pose.planar(2.2, 1.2, 0.5 * math.pi), Pose.planar(3.8, 4.8, 0.5 * math.pi))


def misfits(mesh_map, path):
    """How many poses of a path, each with the heading of a chord, touch something."""
    tracker = PathTracker(path)
    at = np.linspace(0.0, tracker.length, math.ceil(tracker.length / 0.05) + 1)
    chords = tracker.points_at(np.minimum(at + CHORD, tracker.length)) - tracker.points_at(np.maximum(at - CHORD, 0.0))
    mesh_map.check_footprint = True
    return int((mesh_map.outline().touched(mesh_map.locate(tracker.points_at(at)), chords) >= 0).sum())


def test_a_path_turns_to_a_gap_where_the_outline_has_room(floor, make_plugin):
    of_disc = make_plugin(AnyAnglePlanner, free := floor(*GAP, check_footprint=False)).make_plan(THROUGH)
    assert misfits(free, of_disc.path) > 0, "the disc turns so near to the gap that a corner of the outline touches"
    found = make_plugin(AnyAnglePlanner, mesh_map := floor(*GAP)).make_plan(THROUGH)
    assert found.success, found.message
    assert misfits(mesh_map, found.path) == 0


@pytest.mark.parametrize("planner_class", [AStarPlanner, DijkstraPlanner])
def test_paths_along_edges_lead_through_the_gap_too(floor, make_plugin, planner_class):
    found = make_plugin(planner_class, mesh_map := floor(*GAP)).make_plan(THROUGH)
    assert found.success, found.message
    assert misfits(mesh_map, found.path) == 0


def test_a_field_to_follow_leads_through_no_gap_that_has_to_be_driven_straight(floor, make_plugin):
    found = make_plugin(CVPPlanner, floor(*GAP)).make_plan(THROUGH)
    assert found.outcome == GetPathOutcome.NO_PATH_FOUND
    assert "the footprint fits on no path that was tried" in found.message


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_where_nothing_is_near_the_path_is_the_same_to_the_bit(floor, make_plugin, planner_class):
    request = PlanRequest(Pose.planar(0.8, 1.2), Pose.planar(1.2, 5.0))
    paths = [
        make_plugin(planner_class, floor(*GAP, check_footprint=one)).make_plan(request).path for one in (True, False)
    ]
    assert paths[0].positions.tobytes() == paths[1].positions.tobytes()


@pytest.mark.parametrize("planner_class", PLANNERS)
def test_a_bend_that_is_too_narrow_for_the_outline_is_no_path_and_its_place_is_named(floor, make_plugin, planner_class):
    bend = ((-0.1, 2.05, -0.1, 6.1), (2.65, 6.1, 2.75, 6.1), (2.05, 6.1, -0.1, 2.05))  # 0.7 m wide, then 0.7 m
    request = PlanRequest(Pose.planar(2.4, 5.0, -0.5 * math.pi), Pose.planar(5.0, 2.4, 0.0))
    assert make_plugin(planner_class, floor(*bend, check_footprint=False)).make_plan(request).success
    found = make_plugin(planner_class, floor(*bend)).make_plan(request)
    assert found.outcome == GetPathOutcome.NO_PATH_FOUND
    assert "the footprint fits on no path that was tried, first not at (2." in found.message


WALL = (-0.1, 0.55, -0.1, 6.1)


@pytest.mark.parametrize("planner_class", [AStarPlanner, AnyAnglePlanner])
def test_a_robot_beside_a_wall_drives_on_before_it_turns(floor, make_plugin, planner_class):
    mesh_map, start = floor(WALL), Pose.planar(0.85, 2.0, 0.5 * math.pi)
    found = make_plugin(planner_class, mesh_map).make_plan(PlanRequest(start, Pose.planar(3.0, 1.0, 0.0)))
    assert found.success, found.message
    assert found.path.positions[4, 1] > 2.05, "the goal lies behind it, where it has no room to turn to"
    assert misfits(mesh_map, found.path) == 0


def test_a_robot_without_room_to_turn_is_told_how_it_gets_away(floor, make_plugin):
    dead_end = ((-0.1, 2.05, -0.1, 3.0), (2.65, 6.1, -0.1, 3.0), (2.0, 2.7, 3.0, 3.4))
    start, goal = Pose.planar(2.4, 2.4, 0.5 * math.pi), Pose.planar(2.4, 0.5, -0.5 * math.pi)
    found = make_plugin(AStarPlanner, floor(*dead_end)).make_plan(PlanRequest(start, goal))
    assert found.outcome == GetPathOutcome.BLOCKED_START
    assert "the robot cannot turn to its path" in found.message and "it gets away by backing up" in found.message


def test_a_heading_without_room_to_turn_to_it_is_a_blocked_goal(floor, make_plugin):
    aisle = ((-0.1, 6.1, 3.35, 6.1), (-0.1, 6.1, -0.1, 2.65))  # 0.7 m wide
    start, goal = Pose.planar(1.0, 3.0), Pose.planar(5.0, 3.0, math.pi)
    planner = make_plugin(AStarPlanner, floor(*aisle))
    found = planner.make_plan(PlanRequest(start, goal))
    assert found.outcome == GetPathOutcome.BLOCKED_GOAL
    assert "the robot cannot turn to its heading there" in found.message
    assert planner.make_plan(PlanRequest(start, goal, angle_tolerance=math.pi)).success


def test_via_points_are_passed_with_any_heading(floor, make_plugin):
    aisle = ((-0.1, 6.1, 3.35, 6.1), (-0.1, 6.1, -0.1, 2.65))
    via = (Pose.planar(3.0, 3.0, 0.5 * math.pi),)
    request = PlanRequest(Pose.planar(1.0, 3.0), Pose.planar(5.0, 3.0), via=via)
    assert make_plugin(AStarPlanner, floor(*aisle)).make_plan(request).success


def test_a_path_that_is_pulled_straight_keeps_its_turns_before_the_gap(floor, make_plugin):
    mesh_map = floor(*GAP)
    path = make_plugin(AStarPlanner, mesh_map).make_plan(THROUGH).path
    free = floor(*GAP, check_footprint=False)
    of_disc = make_plugin(StringPullingRefiner, free).apply_refinement(path, CancelToken()).path
    assert misfits(free, of_disc) > 0, "the disc is pulled round the ends of the wall"
    pulled = make_plugin(StringPullingRefiner, mesh_map).apply_refinement(path, CancelToken())
    assert pulled.success, pulled.message
    assert misfits(mesh_map, pulled.path) == 0


@pytest.mark.parametrize("controller_class", [PathFollower, MPPIController])
def test_a_controller_gets_through_a_gap_and_touches_nothing_with_its_outline(floor, make_plugin, controller_class):
    mesh_map, start = floor(*GAP), THROUGH.start
    path = make_plugin(AnyAnglePlanner, mesh_map).make_plan(THROUGH).path
    controller = make_plugin(controller_class, mesh_map)
    assert controller.set_plan(path)
    outline, pose, arrived = mesh_map.outline(), start, False
    for _ in range(900):
        arrived = controller.is_goal_reached(pose, 0.15, 0.3)
        if arrived:
            break
        result = controller.compute_velocity_commands(ControlRequest(pose, Twist()))
        assert result.success, result.message
        driven = (result.command.vx, 0.0, result.command.wz, 0.1, 0.1)
        pose = Pose.planar(*arc_poses((pose.x, pose.y, pose.yaw), *driven)[-1].tolist())
        assert not outline.touches(mesh_map.locate_one(pose.position), pose)
    assert arrived
