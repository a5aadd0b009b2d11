"""What every backend does when it drives: straight, in loops, there and back, past obstacles, after newer goals."""

from __future__ import annotations

import math
from dataclasses import replace

from mbf_abstract.geometry import Path
from mbf_abstract.goals.feedback_types import MoveBaseFeedback
from mbf_abstract.goals.goal_area import DiscArea
from mbf_abstract.goals.goal_types import ExePathGoal, MoveBaseGoal
from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_abstract.testing.conformance.rig import START, Box, T_map_dock
from mbf_abstract.testing.conformance.site import Site, situation, somewhere

CORNERS = ((2.0, 4.0), (5.0, 4.0), (5.0, 6.0), (2.0, 6.0), (2.0, 4.0))
EIGHT = tuple(
    (2.0 + 1.4 * math.sin(2.0 * math.pi * k / 80), 4.0 + 1.5 * math.sin(4.0 * math.pi * k / 80)) for k in range(81)
)
"""A figure of eight through the robot's start, which it crosses halfway."""


@situation()
def a_path_is_driven_to_its_end(site: Site) -> None:
    """A path is driven to its end, and the robot stands there."""
    result = site.navigator.exe_path(site.path((2.0, 4.0), (5.0, 4.0)))
    site.expect_outcome(result, ExePathOutcome.SUCCESS)
    site.expect_near(5.0, 4.0, 0.25, "arrived")
    site.expect_stands(0.5, "the robot stands at its goal")


@situation()
def a_loop_is_driven_whole(site: Site) -> None:
    """A path that ends where it began is driven whole, not arrived at once."""
    result = site.navigator.exe_path(site.path(*CORNERS))
    site.expect_outcome(result, ExePathOutcome.SUCCESS)
    site.expect_visits(CORNERS)


@situation()
def a_path_out_and_back_is_driven_whole(site: Site) -> None:
    """A path that turns back on itself is driven to its turn and back."""
    corners = ((2.0, 4.0), (5.0, 4.0), (2.2, 4.0))
    result = site.navigator.exe_path(site.path(*corners))
    site.expect_outcome(result, ExePathOutcome.SUCCESS)
    site.expect_visits(corners)


@situation()
def a_figure_of_eight_is_driven_in_order(site: Site) -> None:
    """A path that crosses itself is driven in its order, with both of its loops."""
    result = site.navigator.exe_path(site.path(*EIGHT))
    site.expect_outcome(result, ExePathOutcome.SUCCESS)
    site.expect_visits(EIGHT[::10])


@situation(controller_max_retries=0)
def an_obstacle_on_the_path_stops_the_robot(site: Site) -> None:
    """An obstacle on the path ends driving with BLOCKED_PATH and its place, before it is touched."""
    site.place(Box(4.5, 3.0, 4.8, 5.0))
    result = site.navigator.exe_path(site.path((2.0, 4.0), (8.0, 4.0)))
    site.expect_outcome(result, ExePathOutcome.BLOCKED_PATH, "an obstacle is in the way", "would touch it at (4.")
    site.expect_no_contact()
    site.expect(site.rig.robot.pose.x > 2.5, "the robot did not even drive up to the obstacle")


@situation(planner_frequency=2.0)
def a_goal_behind_an_obstacle_is_reached(site: Site) -> None:
    """move_base drives around an obstacle that it sees while it drives."""
    handle = site.navigator.send(MoveBaseGoal(somewhere(7.0, 4.0)))
    site.rig.clock.sleep(0.5)
    site.rig.boxes = [Box(4.5, 3.5, 4.8, 4.6)]
    site.expect_outcome(handle.wait(120.0), MoveBaseOutcome.SUCCESS)
    site.expect_near(7.0, 4.0, 0.3, "arrived")
    site.expect_no_contact()


@situation()
def a_goal_area_ends_the_drive_at_its_border(site: Site) -> None:
    """With a goal area the robot stops as soon as it is inside."""
    area = DiscArea(somewhere(6.0, 4.0), 1.0)
    result = site.navigator.go_to(somewhere(6.0, 4.0), goal_area=area)
    site.expect_outcome(result, MoveBaseOutcome.SUCCESS)
    pose = site.rig.robot.pose
    site.expect(area.contains(pose), f"the robot stands {area.depth(pose):.2f} m inside the area")
    site.expect(pose.x < 5.5, f"the robot drove on to x = {pose.x:.2f} m, the area begins at 5 m")


@situation()
def a_wide_tolerance_ends_the_drive_early(site: Site) -> None:
    """The goal's tolerance decides where a robot has arrived."""
    result = site.navigator.exe_path(site.path((2.0, 4.0), (6.0, 4.0)), dist_tolerance=1.0)
    site.expect_outcome(result, ExePathOutcome.SUCCESS)
    pose = site.rig.robot.pose
    site.expect(4.9 < pose.x < 5.6, f"the robot stands at x = {pose.x:.2f} m, tolerated is 5 m")


@situation()
def a_path_in_another_frame_is_driven(site: Site) -> None:
    """A path in another known frame is driven, and its result is in the frame of the map."""
    result = site.navigator.exe_path(T_map_dock.inverse().apply_to_path(site.path((2.0, 4.0), (4.0, 4.0))))
    site.expect_outcome(result, ExePathOutcome.SUCCESS)
    site.expect_near(4.0, 4.0, 0.25, "arrived")
    frame = None if result.final_pose is None else result.final_pose.frame_id
    site.expect(frame == "map", f"the final pose is in the frame {frame!r}")


@situation()
def a_path_without_poses_is_invalid(site: Site) -> None:
    """A path without poses ends with INVALID_PATH; one of a single pose is driven to."""
    site.expect_outcome(site.navigator.exe_path(Path.from_poses([])), ExePathOutcome.INVALID_PATH, "no poses")
    single = Path.from_poses([somewhere(2.8, 4.0)])
    site.expect_outcome(site.navigator.exe_path(single), ExePathOutcome.SUCCESS)
    site.expect_near(2.8, 4.0, 0.25, "arrived")


@situation(controller_max_retries=0)
def a_robot_that_left_the_map_stands(site: Site) -> None:
    """A robot outside the map that it drives on ends its path with OUT_OF_MAP, and gets no plan on any map.

    A window around the robot has no outside: as in Nav2 and MBF only what is in it stops the robot there.
    """
    site.rig.robot.T_map_odom = replace(site.rig.robot.T_map_odom, translation=(-4.0, 0.0, 0.0))
    site.rig.clock.sleep(0.6)
    here = site.server.runtime.robot.pose()
    outside = site.map.point_check()(here).state is CellState.OUTSIDE
    plan = site.navigator.go_to(somewhere(5.0, 4.0), recovery_behaviors=())
    site.expect_outcome(plan, GetPathOutcome.OUT_OF_MAP, "start (-2.00, 4.00")
    result = site.navigator.exe_path(site.path((here.x, here.y), (0.0, 4.0)))
    if outside:
        site.expect_outcome(result, ExePathOutcome.OUT_OF_MAP, "the robot (-2.00, 4.00", "is outside the map")
        site.expect_stands(0.5, "the robot left the map")
    else:
        site.expect_outcome(result, ExePathOutcome.SUCCESS)


@situation()
def a_robot_that_ignores_its_commands_is_stuck(site: Site) -> None:
    """A robot that does not follow its commands ends the path with ROBOT_STUCK."""
    site.rig.robot.stuck = True
    site.expect_outcome(site.navigator.exe_path(site.path((2.0, 4.0), (5.0, 4.0))), ExePathOutcome.ROBOT_STUCK)


@situation()
def plugins_that_are_not_loaded_are_named(site: Site) -> None:
    """A goal for a plugin that is not loaded ends with INVALID_PLUGIN, its name and the names that are loaded."""
    path, name = site.path((2.0, 4.0), (5.0, 4.0)), "'nobody'; loaded: "
    site.expect_outcome(
        site.navigator.get_path(somewhere(5.0, 4.0), planner="nobody"), GetPathOutcome.INVALID_PLUGIN, name
    )
    site.expect_outcome(site.navigator.exe_path(path, controller="nobody"), ExePathOutcome.INVALID_PLUGIN, name)
    site.expect_outcome(site.navigator.recover("nobody"), RecoveryOutcome.INVALID_PLUGIN, name, "back_up")


@situation(controller_patience=1.0)
def one_controller_drives_one_path(site: Site) -> None:
    """A path in another slot waits for the controller that drives and ends with PAT_EXCEEDED; the drive goes on."""
    first = site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (6.0, 4.0))))
    site.rig.clock.sleep(0.5)
    second = site.navigator.exe_path(site.path((2.0, 4.0), (3.0, 4.0)), concurrency_slot=1)
    site.expect_outcome(second, ExePathOutcome.PAT_EXCEEDED, "uses")
    site.expect_outcome(first.wait(60.0), ExePathOutcome.SUCCESS)


@situation()
def a_newer_path_takes_over_while_driving(site: Site) -> None:
    """A newer path in the same slot takes over without a stop; the older goal ends CANCELED."""
    first = site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (8.0, 4.0))))
    site.rig.clock.sleep(2.0)
    here = site.rig.robot.pose
    second = site.navigator.send(ExePathGoal(site.path((here.x, here.y), (here.x + 1.0, here.y), (6.0, 6.0))))
    site.rig.clock.sleep(0.3)
    site.expect(not site.rig.robot.command.is_stopped(), "the robot stopped for the newer path")
    site.expect_outcome(first.wait(1.0), ExePathOutcome.CANCELED, "preempted")
    site.expect_outcome(second.wait(60.0), ExePathOutcome.SUCCESS)
    site.expect_near(6.0, 6.0, 0.3, "arrived at the newer goal")


@situation()
def a_newer_goal_takes_over_while_driving(site: Site) -> None:
    """A newer goal of move_base takes over; the older one ends CANCELED."""
    first = site.navigator.send(MoveBaseGoal(somewhere(8.0, 4.0)))
    site.rig.clock.sleep(2.0)
    second = site.navigator.send(MoveBaseGoal(somewhere(5.0, 6.0)))
    site.expect_outcome(first.wait(1.0), MoveBaseOutcome.CANCELED)
    site.expect_outcome(second.wait(60.0), MoveBaseOutcome.SUCCESS)
    site.expect_near(5.0, 6.0, 0.3, "arrived at the newer goal")


@situation(planner_frequency=2.0)
def via_poses_are_driven_through_without_a_stop(site: Site) -> None:
    """move_base passes its via poses in order, also one behind an obstacle and one on the way back, without a stop."""
    places = ((3.0, 4.0), (4.0, 4.2), (6.5, 4.0))
    handle = site.navigator.send(MoveBaseGoal(somewhere(5.5, 5.5), via=tuple(somewhere(*place) for place in places)))
    seen: list[tuple[int, bool]] = []

    def note(feedback: MoveBaseFeedback) -> None:
        seen.append((feedback.via_left, site.rig.robot.command.is_stopped()))

    handle.add_feedback_callback(note)
    site.rig.clock.sleep(0.5)
    site.rig.boxes = [Box(5.2, 3.5, 5.5, 4.5)]
    site.expect_outcome(handle.wait(120.0), MoveBaseOutcome.SUCCESS)
    site.expect_visits((*places, (5.5, 5.5)))
    site.expect_near(5.5, 5.5, 0.3, "arrived")
    site.expect_no_contact()
    left = [count for count, _ in seen]
    site.expect(left == sorted(left, reverse=True), f"via_left went up again: {left}")
    site.expect(left[:1] == [3] and left[-1:] == [0], f"via_left went from {left[:1]} to {left[-1:]}, not from 3 to 0")
    behind = [stopped for count, stopped in seen if count == 2]
    site.expect(bool(behind) and not any(behind), "the robot stopped at its first via pose")


@situation()
def a_blocked_via_pose_ends_the_goal_and_is_named(site: Site) -> None:
    """A via pose on an obstacle ends the goal with the outcome of its leg and a text that names the pose."""
    site.place(Box(4.0, 3.5, 4.4, 4.5))
    via = (somewhere(3.0, 4.0), somewhere(4.0, 4.0))
    result = site.navigator.go_to(somewhere(3.0, 5.0), via=via, recovery_behaviors=())
    site.expect_outcome(result, GetPathOutcome.BLOCKED_GOAL, "via pose 2")
    site.expect_near(START.x, START.y, 0.1, "nothing was driven")


@situation()
def a_paused_goal_stands_and_goes_on(site: Site) -> None:
    """A paused goal stands however long, and goes on when it is resumed."""
    handle = site.navigator.send(MoveBaseGoal(somewhere(6.0, 4.0)))
    site.rig.clock.sleep(1.5)
    handle.pause()
    site.rig.clock.sleep(0.3)
    site.expect_stands(6.0, "paused")
    handle.resume()
    site.expect_outcome(handle.wait(60.0), MoveBaseOutcome.SUCCESS)
