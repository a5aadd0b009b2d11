"""Paths of every backend: goals free and blocked, tolerances, via points, frames."""

from __future__ import annotations

import math

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_area import DiscArea
from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.testing.conformance.rig import ROBOT_RADIUS, START, Box, T_map_dock
from mbf_abstract.testing.conformance.site import Site, situation, somewhere

WALL = Box(4.0, 3.5, 4.4, 4.5)
FACE = somewhere(4.0, 4.0)
"""Where the sensor sees the wall first."""
NEAR = somewhere(3.85, 4.0)
"""A place from which a robot would touch the wall."""
BEYOND = somewhere(3.5, 4.0)
"""A place half a metre before the wall, which the coarsest map still takes for free."""
CAGE = (Box(0.6, 2.6, 3.4, 2.8), Box(0.6, 5.2, 3.4, 5.4), Box(0.6, 2.6, 0.8, 5.4), Box(3.2, 2.6, 3.4, 5.4))
"""Four walls around the robot's start, 1.2 m away."""


def expect_clear_of_face(site: Site, path: Path | None) -> None:
    """Expect that a path, if there is one, keeps away from the wall's face."""
    if path is not None:
        gap = min(math.hypot(x - 4.0, max(abs(y - 4.0) - 0.5, 0.0)) for x, y, _ in path.positions.tolist())
        site.expect(gap > ROBOT_RADIUS - 0.1, f"the path passes the wall's face at {gap:.2f} m")


def _end(path: Path | None, x: float, y: float) -> float:
    """Distance [m] of a path's end from a place; inf without a path."""
    return math.inf if path is None or not len(path) else path[-1].distance_to(somewhere(x, y))


@situation()
def a_free_goal_gets_a_free_path(site: Site) -> None:
    """A path over empty ground leads from the robot to the goal and nowhere else."""
    plan = site.navigator.get_path(somewhere(9.0, 6.0))
    site.expect_outcome(plan, GetPathOutcome.SUCCESS)
    if plan.path is None:
        return
    site.expect(plan.path[0].distance_to(START) < 0.3, "the path begins away from the robot")
    site.expect(_end(plan.path, 9.0, 6.0) < 0.2, f"the path ends {_end(plan.path, 9.0, 6.0):.2f} m from the goal")
    site.expect(7.2 < plan.path.length < 8.6, f"the path is {plan.path.length:.2f} m long, the goal 7.28 m away")
    site.expect(plan.cost > 0.0, f"the path costs {plan.cost:g}")
    worst = site.server.queries.check_path(plan.path).state
    site.expect(worst in (CellState.FREE, CellState.UNKNOWN), f"check_path returns {worst.name} for the path")


@situation()
def a_path_leads_around_what_was_seen(site: Site) -> None:
    """A plan keeps away from an obstacle that only the sensor knows, by the radius of the robot."""
    site.place(WALL)
    plan = site.navigator.get_path(somewhere(7.0, 4.0))
    site.expect_outcome(plan, GetPathOutcome.SUCCESS)
    expect_clear_of_face(site, plan.path)


@situation()
def a_goal_inside_walls_is_not_found(site: Site) -> None:
    """A goal that cannot be reached ends with NO_PATH_FOUND."""
    site.place(*CAGE)
    plan = site.navigator.get_path(somewhere(8.0, 4.0))
    site.expect_outcome(plan, GetPathOutcome.NO_PATH_FOUND)


@situation()
def a_blocked_goal_is_named(site: Site) -> None:
    """A goal on an obstacle ends with BLOCKED_GOAL if the path must end exactly there."""
    site.place(WALL)
    site.expect_outcome(site.navigator.get_path(FACE, dist_tolerance=0.0), GetPathOutcome.BLOCKED_GOAL, "goal (4.00")


@situation()
def a_goal_where_the_robot_would_touch_something_is_blocked(site: Site) -> None:
    """A goal nearer to an obstacle than the robot's radius ends with BLOCKED_GOAL.

    With a tolerance the path ends where the robot touches nothing. A goal just beyond the radius is reached.
    """
    site.place(WALL)
    site.expect_outcome(site.navigator.get_path(NEAR, dist_tolerance=0.0), GetPathOutcome.BLOCKED_GOAL)
    plan = site.navigator.get_path(NEAR, dist_tolerance=0.6)
    site.expect_outcome(plan, GetPathOutcome.SUCCESS)
    end = _end(plan.path, NEAR.x, NEAR.y)
    site.expect(end <= 0.6, f"the path ends {end:.2f} m from the goal, allowed is 0.6 m")
    if plan.path is not None:
        state = site.server.queries.check_pose(plan.path[-1]).state
        site.expect(state <= CellState.INSCRIBED, f"check_pose returns {state.name} where the path ends")
    beyond = site.navigator.get_path(BEYOND, dist_tolerance=0.0)
    site.expect_outcome(beyond, GetPathOutcome.SUCCESS)


@situation()
def a_blocked_start_is_named(site: Site) -> None:
    """A start on an obstacle ends with BLOCKED_START and what would, or would not, get the robot away from there."""
    site.place(WALL)
    plan = site.navigator.get_path(somewhere(7.0, 2.0), start_pose=FACE)
    site.expect_outcome(plan, GetPathOutcome.BLOCKED_START, "start (4.00", " away")


@situation()
def a_pose_off_the_ground_is_out_of_map(site: Site) -> None:
    """A start, via pose or goal where there is no ground ends with OUT_OF_MAP and the name of the pose."""
    plan, away = site.navigator.get_path, somewhere(40.0, 4.0)
    site.expect_outcome(plan(away), GetPathOutcome.OUT_OF_MAP, "goal (40.00, 4.00")
    site.expect_outcome(plan(somewhere(5.0, 4.0), start_pose=away), GetPathOutcome.OUT_OF_MAP, "start (40.00, 4.00")
    site.expect_outcome(plan(somewhere(5.0, 4.0), via=(away,)), GetPathOutcome.OUT_OF_MAP, "via pose 1 (40.00, 4.00")
    site.expect_outcome(site.navigator.go_to(away), GetPathOutcome.OUT_OF_MAP, "goal (40.00, 4.00")
    site.expect_near(START.x, START.y, 0.05, "there was nowhere to go")


@situation()
def a_tolerance_reaches_past_the_border(site: Site) -> None:
    """A goal past the border of the ground is approached to within its tolerance, and not without one."""
    past = somewhere(12.4, 4.0)
    site.expect_outcome(site.navigator.get_path(past, dist_tolerance=0.0), GetPathOutcome.OUT_OF_MAP)
    plan = site.navigator.get_path(past, dist_tolerance=1.0)
    site.expect_outcome(plan, GetPathOutcome.SUCCESS)
    site.expect(_end(plan.path, 12.4, 4.0) <= 1.0, f"the path ends {_end(plan.path, 12.4, 4.0):.2f} m from the goal")


@situation()
def a_goal_high_above_the_ground_is_out_of_map(site: Site) -> None:
    """A goal metres above or below the ground ends with OUT_OF_MAP on a map with heights; a flat map has none."""
    flat = site.map.same_storey == math.inf
    for z in (-2.0, 3.0):
        plan = site.navigator.get_path(Pose.planar(5.0, 4.0, z=z))
        site.expect_outcome(plan, GetPathOutcome.SUCCESS if flat else GetPathOutcome.OUT_OF_MAP)


@situation()
def a_tolerance_lets_a_path_end_beside_a_blocked_goal(site: Site) -> None:
    """A tolerance of the goal lets the path end beside what blocks it, and no farther."""
    site.place(WALL)
    plan = site.navigator.get_path(FACE, dist_tolerance=1.0)
    site.expect_outcome(plan, GetPathOutcome.SUCCESS, " m from the goal (tolerance 1.00 m)")
    end = _end(plan.path, FACE.x, FACE.y)
    site.expect(0.2 < end <= 1.0, f"the path ends {end:.2f} m from the goal, allowed is 1 m")


@situation()
def a_tolerance_that_does_not_help_is_named(site: Site) -> None:
    """A goal that cannot be reached even within its tolerance says so; without a tolerance nothing is said of it."""
    site.place(WALL)
    text = "no place within 0.05 m of it can be reached either"
    site.expect_outcome(site.navigator.get_path(FACE, dist_tolerance=0.05), GetPathOutcome.BLOCKED_GOAL, text)
    exact = site.navigator.get_path(FACE, dist_tolerance=0.0)
    site.expect_outcome(exact, GetPathOutcome.BLOCKED_GOAL)
    site.expect("can be reached" not in exact.message, f"no tolerance was given: {exact.message}")
    site.place(*CAGE)
    walled_in = site.navigator.get_path(somewhere(8.0, 4.0), dist_tolerance=0.05)
    site.expect_outcome(walled_in, GetPathOutcome.NO_PATH_FOUND, text)


@situation()
def via_points_are_passed(site: Site) -> None:
    """A path leads by its via points, in their order."""
    via = (somewhere(4.0, 6.0), somewhere(7.0, 2.0))
    plan = site.navigator.get_path(somewhere(9.0, 4.0), via=via)
    site.expect_outcome(plan, GetPathOutcome.SUCCESS)
    if plan.path is None:
        return
    nearest = [min(range(len(plan.path)), key=lambda i, at=pose: plan.path[i].distance_to(at)) for pose in via]  # type: ignore[misc]
    gaps = [plan.path[i].distance_to(pose) for i, pose in zip(nearest, via, strict=True)]
    site.expect(max(gaps) < 0.3, f"the path passes its via points at {gaps[0]:.2f} m and {gaps[1]:.2f} m")
    site.expect(nearest[0] < nearest[1], "the path passes its via points in another order")


@situation()
def any_member_of_a_goal_area_will_do(site: Site) -> None:
    """A goal area whose centre is blocked is reached at another place."""
    site.place(WALL)
    area = DiscArea(somewhere(4.0, 4.0), 1.2)
    plan = site.navigator.get_path(somewhere(4.0, 4.0), goal_area=area)
    site.expect_outcome(plan, GetPathOutcome.SUCCESS)
    if plan.path is not None:
        site.expect(area.contains(plan.path[-1]), "the path ends outside the area")


@situation()
def a_goal_area_of_another_frame_is_transformed(site: Site) -> None:
    """A goal area is given in any known frame, as a pose is; in an unknown one it ends with TF_ERROR and its name."""
    goal = somewhere(6.0, 4.0)
    area = DiscArea(T_map_dock.inverse().apply_to_pose(goal), 1.0)
    site.expect_outcome(site.navigator.get_path(goal, goal_area=area), GetPathOutcome.SUCCESS)
    site.expect_outcome(site.navigator.go_to(goal, goal_area=area), GetPathOutcome.SUCCESS)
    site.expect_near(6.0, 4.0, 1.0, "the area is around (6, 4)")
    lost = site.navigator.get_path(goal, goal_area=DiscArea(somewhere(6.0, 4.0, "nowhere"), 1.0))
    site.expect_outcome(lost, GetPathOutcome.TF_ERROR, "nowhere")


@situation()
def a_goal_in_another_frame_is_transformed(site: Site) -> None:
    """A goal in a known frame is planned for in the map, one in an unknown frame ends with TF_ERROR."""
    there = T_map_dock.apply_to_pose(somewhere(1.0, -2.0, "dock"))
    plan = site.navigator.get_path(somewhere(1.0, -2.0, "dock"))
    site.expect_outcome(plan, GetPathOutcome.SUCCESS)
    end = _end(plan.path, there.x, there.y)
    site.expect(end < 0.2, f"the path ends {end:.2f} m from the goal")
    site.expect_outcome(site.navigator.get_path(somewhere(1.0, 1.0, "nowhere")), GetPathOutcome.TF_ERROR, "nowhere")


@situation(planner_patience=1.0)
def a_planner_out_of_time_ends_with_pat_exceeded(site: Site) -> None:
    """A planner that takes longer than its patience ends with PAT_EXCEEDED."""
    planner = site.server.plugins.all_of(PluginKind.PLANNER)[0].instance
    planner.modelled_compute_time = 10.0
    site.expect_outcome(site.navigator.get_path(somewhere(9.0, 4.0)), GetPathOutcome.PAT_EXCEEDED)
