"""How the recoveries of every backend end: done, out of time, refused by the gate, blocked, lost."""

from __future__ import annotations

from mbf_abstract.events import EventKind
from mbf_abstract.goals.goal_types import ExePathGoal, RecoveryGoal
from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.testing.conformance.planning import CAGE, FACE, WALL
from mbf_abstract.testing.conformance.rig import Box
from mbf_abstract.testing.conformance.site import Site, situation, somewhere

MOVING = ("rotate", "back_up")


@situation()
def wait_stands_for_its_time(site: Site) -> None:
    """The recovery wait stands for its duration and succeeds."""
    site.server.set_plugin_parameters(PluginKind.RECOVERY, "wait", duration=2.0)
    before = site.rig.clock.now()
    site.expect_outcome(site.navigator.recover("wait"), RecoveryOutcome.SUCCESS)
    took = site.rig.clock.now() - before
    site.expect(1.9 < took < 2.5, f"it took {took:.2f} s instead of 2 s")
    site.expect_near(2.0, 4.0, 0.01, "after waiting")


@situation()
def rotate_turns_and_stays(site: Site) -> None:
    """The recovery rotate turns by its angle and stays where it is."""
    site.server.set_plugin_parameters(PluginKind.RECOVERY, "rotate", angle=1.5)
    site.expect_outcome(site.navigator.recover("rotate"), RecoveryOutcome.SUCCESS)
    yaw = site.rig.robot.pose.yaw
    site.expect(1.3 < yaw < 1.7, f"it turned {yaw:.2f} rad instead of 1.5 rad")
    site.expect_near(2.0, 4.0, 0.05, "after turning")


@situation()
def back_up_goes_back(site: Site) -> None:
    """The recovery back_up drives backward by its distance."""
    site.server.set_plugin_parameters(PluginKind.RECOVERY, "back_up", distance=0.5)
    site.expect_outcome(site.navigator.recover("back_up"), RecoveryOutcome.SUCCESS)
    site.expect_near(1.5, 4.0, 0.1, "after backing up")


@situation()
def back_up_stops_before_an_obstacle(site: Site) -> None:
    """The recovery back_up ends with IMPASSABLE before it touches what is behind the robot."""
    site.place(Box(0.5, 3.0, 1.3, 5.0))
    site.server.set_plugin_parameters(PluginKind.RECOVERY, "back_up", distance=1.0)
    site.expect_outcome(site.navigator.recover("back_up"), RecoveryOutcome.IMPASSABLE)
    site.expect_no_contact()


@situation()
def clear_frees_what_is_gone(site: Site) -> None:
    """The recovery clear forgets marks, and what is still there is seen again."""
    site.place(WALL)
    site.rig.sensing = False
    site.expect_outcome(site.navigator.recover("clear"), RecoveryOutcome.SUCCESS)
    site.expect_free(FACE)
    site.rig.sensing = True
    site.rig.clock.sleep(0.6)
    site.server.queries.update_map()
    site.expect_state(FACE, CellState.LETHAL)


@situation()
def clear_names_what_has_forgotten(site: Site) -> None:
    """The recovery clear names the layers that sensors fill, and no others."""
    layers = {name: bool(layer.source_names) for name, layer in site.map.layers.items()}
    everything = site.navigator.recover("clear").message
    for name, sensed in layers.items():
        site.expect((name in everything) == sensed, f"layer {name!r}, sensed: {sensed}; the message is {everything!r}")
    others = [name for name, sensed in layers.items() if not sensed]
    if others:
        site.server.set_plugin_parameters(PluginKind.RECOVERY, "clear", layers=others)
        site.expect_outcome(site.navigator.recover("clear"), RecoveryOutcome.SUCCESS, "cleared nothing")


@situation()
def relax_grants_a_tolerance_for_its_time(site: Site) -> None:
    """The recovery relax lets paths end beside a blocked goal for its duration, and no longer."""
    site.place(WALL)
    relaxed = {"planner_tolerance": 1.0, "duration": 3.0}
    site.server.set_plugin_parameters(PluginKind.RECOVERY, "relax", **relaxed)
    for outcome in (GetPathOutcome.BLOCKED_GOAL, GetPathOutcome.SUCCESS, GetPathOutcome.BLOCKED_GOAL):
        site.expect_outcome(site.navigator.get_path(FACE, dist_tolerance=0.0), outcome)
        if outcome == GetPathOutcome.SUCCESS:
            site.rig.clock.sleep(4.0)
        else:
            site.expect_outcome(site.navigator.recover("relax"), RecoveryOutcome.SUCCESS)


@situation()
def move_away_gains_distance(site: Site) -> None:
    """The recovery move_away drives away from an obstacle up to its clearance."""
    site.place(Box(2.5, 3.0, 2.8, 5.0))
    site.server.set_plugin_parameters(PluginKind.RECOVERY, "move_away", clearance=0.9)
    site.expect_outcome(site.navigator.recover("move_away"), RecoveryOutcome.SUCCESS)
    gap = 2.5 - site.rig.robot.pose.x
    site.expect(0.75 < gap < 1.1, f"the robot's centre is {gap:.2f} m from the obstacle, wanted is 0.9 m")


@situation()
def move_away_between_obstacles_is_impassable(site: Site) -> None:
    """The recovery move_away ends with IMPASSABLE where it would only come nearer to something else."""
    site.place(Box(2.5, 3.0, 2.8, 5.0), Box(1.2, 3.0, 1.5, 5.0))
    site.server.set_plugin_parameters(PluginKind.RECOVERY, "move_away", clearance=0.9)
    site.expect_outcome(site.navigator.recover("move_away"), RecoveryOutcome.IMPASSABLE)
    site.expect_no_contact()


@situation()
def a_recovery_out_of_time_ends_with_pat_exceeded(site: Site) -> None:
    """A recovery whose own time limit is over ends with PAT_EXCEEDED."""
    site.rig.robot.stuck = True
    for behavior in MOVING:
        site.server.set_plugin_parameters(PluginKind.RECOVERY, behavior, time_limit=2.0)
        site.expect_outcome(site.navigator.recover(behavior), RecoveryOutcome.PAT_EXCEEDED, "2 s")
        site.expect(site.rig.robot.command.is_stopped(), f"{behavior} left the robot with {site.rig.robot.command}")


@situation(recovery_patience=1.0)
def a_recovery_beyond_the_patience_ends_with_pat_exceeded(site: Site) -> None:
    """A recovery that takes longer than recovery_patience ends with PAT_EXCEEDED."""
    site.rig.robot.stuck = True
    for behavior in ("wait", *MOVING):
        site.expect_outcome(site.navigator.recover(behavior), RecoveryOutcome.PAT_EXCEEDED)
        site.expect(site.rig.robot.command.is_stopped(), f"{behavior} left the robot with {site.rig.robot.command}")


@situation()
def a_recovery_beside_a_drive_is_stopped(site: Site) -> None:
    """A recovery whose commands the gate refuses, as another goal drives, ends with STOPPED; the drive goes on."""
    drive = site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (9.0, 4.0))))
    site.rig.clock.sleep(0.5)
    for behavior in ("wait", *MOVING):
        site.expect_outcome(site.navigator.recover(behavior), RecoveryOutcome.STOPPED, "gate")
    site.expect(not drive.done, "the drive has ended")
    site.expect_outcome(drive.wait(60.0), ExePathOutcome.SUCCESS)


@situation()
def a_lost_robot_is_a_tf_error(site: Site) -> None:
    """A recovery that does not know where the robot is ends with TF_ERROR."""
    site.rig.robot.publishes_pose = site.rig.sensing = False
    site.rig.clock.sleep(1.5)
    for behavior in MOVING:
        site.expect_outcome(site.navigator.recover(behavior), RecoveryOutcome.TF_ERROR)


@situation()
def a_paused_recovery_stands_and_goes_on(site: Site) -> None:
    """A recovery stands while it is paused, and finishes when it is resumed."""
    handle = site.navigator.send(RecoveryGoal("rotate"))
    site.expect_moves(0.6, "before the pause")
    handle.pause()
    site.rig.clock.sleep(0.2)
    site.expect_stands(3.0, "paused")
    handle.resume()
    site.expect_outcome(handle.wait(60.0), RecoveryOutcome.SUCCESS)


@situation()
def move_base_recovers_and_gives_up(site: Site) -> None:
    """move_base tries its recoveries in order, plans again after each, and ends with the planner's code."""
    site.place(*CAGE)
    result = site.navigator.go_to(somewhere(8.0, 4.0), recovery_behaviors=("wait", "rotate"))
    site.expect(
        result.outcome not in (MoveBaseOutcome.SUCCESS, MoveBaseOutcome.CANCELED), f"it ended {result.outcome_name}"
    )
    steps = site.rig.memory.of_kind(EventKind.STATE_CHANGED)
    ran = [step.data["behavior"] for step in steps if "behavior" in step.data]
    site.expect(ran == ["wait", "rotate"], f"it ran {ran}")
