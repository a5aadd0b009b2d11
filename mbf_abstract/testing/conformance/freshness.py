"""A map whose sensor is silent, whose marks were cleared, or whose stamps lie in the future is not driven on."""

from __future__ import annotations

from mbf_abstract.goals.goal_types import ExePathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_abstract.testing.conformance.planning import FACE, WALL, expect_clear_of_face
from mbf_abstract.testing.conformance.rig import MAX_SILENCE, SENSOR
from mbf_abstract.testing.conformance.site import Site, situation, somewhere

SILENT = MAX_SILENCE + 0.5  # s after which the robot must stand


@situation(controller_patience=20.0)
def a_silent_sensor_holds_the_robot_while_it_drives(site: Site) -> None:
    """The robot stands while its sensor is silent, and drives on when it sends again."""
    handle = site.navigator.send(MoveBaseGoal(somewhere(8.0, 4.0)))
    site.expect_moves(1.0, "with a sensor that works")
    site.rig.sensing = False
    site.rig.clock.sleep(SILENT)
    site.expect_stands(3.0, "the sensor is silent")
    site.expect(
        SENSOR in site.server.map_problem(), f"map_problem does not name the sensor: {site.server.map_problem()!r}"
    )
    site.rig.sensing = True
    site.expect_moves(1.5, "the sensor sends again")
    site.expect_outcome(handle.wait(60.0), MoveBaseOutcome.SUCCESS)


@situation()
def a_sensor_that_stays_silent_ends_the_path_with_map_error(site: Site) -> None:
    """A path that cannot be driven because the sensor stays silent ends with MAP_ERROR and the sensor's name."""
    handle = site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (9.0, 4.0))))
    site.rig.clock.sleep(1.0)
    site.rig.sensing = False
    site.expect_outcome(handle.wait(30.0), ExePathOutcome.MAP_ERROR, SENSOR)


@situation()
def a_silent_sensor_holds_a_recovery(site: Site) -> None:
    """A recovery stands while the sensor is silent, and finishes when it sends again."""
    handle = site.navigator.send(RecoveryGoal("rotate"))
    site.expect_moves(0.5, "with a sensor that works")
    site.rig.sensing = False
    site.rig.clock.sleep(SILENT)
    site.expect_stands(3.0, "the sensor is silent")
    site.rig.sensing = True
    site.expect_moves(1.5, "the sensor sends again")
    site.expect_outcome(handle.wait(60.0), RecoveryOutcome.SUCCESS)


@situation(controller_patience=20.0)
def a_cleared_map_is_not_driven_on_until_it_sees_again(site: Site) -> None:
    """After clearing all or the surroundings, by query or by recovery, the robot stands until a scan is in the map."""
    site.place(WALL)
    queries = site.server.queries
    for clear in (queries.clear_map, lambda: queries.clear_area(5.0), lambda: site.navigator.recover("clear")):
        site.rig.sensing = False
        clear()
        site.expect(bool(site.server.map_problem()), "a map that has forgotten what it saw counts as current")
        here = site.rig.robot.pose
        handle = site.navigator.send(ExePathGoal(site.path((here.x, here.y), (here.x, here.y + 1.0))))
        site.expect_stands(0.6, "the map was cleared and nothing was seen since")
        site.rig.sensing = True
        site.expect_outcome(handle.wait(30.0), ExePathOutcome.SUCCESS)


@situation()
def a_plan_after_a_clearing_knows_what_is_seen(site: Site) -> None:
    """After clearing all or the surroundings, by query or by recovery, a plan leads around what the sensor sees."""
    site.place(WALL)
    queries = site.server.queries
    for clear in (queries.clear_map, lambda: queries.clear_area(5.0), lambda: site.navigator.recover("clear")):
        clear()
        plan = site.navigator.get_path(somewhere(7.0, 4.0))
        site.expect_outcome(plan, GetPathOutcome.SUCCESS)
        expect_clear_of_face(site, plan.path)


@situation()
def a_plan_after_a_clearing_waits_for_no_silent_sensor(site: Site) -> None:
    """A sensor that is silent after a clearing delays a plan by no more than it may be silent."""
    site.rig.sensing = False
    site.server.queries.clear_map()
    began = site.rig.clock.now()
    site.expect_outcome(site.navigator.get_path(somewhere(7.0, 4.0)), GetPathOutcome.SUCCESS)
    took = site.rig.clock.now() - began
    site.expect(took < SILENT, f"the plan took {took:.2f} s")


@situation(controller_patience=20.0)
def a_stamp_from_the_future_is_no_sign_of_life(site: Site) -> None:
    """A scan from the future does not keep the map current, and holds the robot until one of now comes."""
    site.rig.sensing = False
    now = site.rig.clock.now()
    try:
        site.server.take_scan(site.ray(2.0, 3.9, hit=False, stamp=now + 60.0))
    except ValueError:
        pass  # refused is as good
    handle = site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (4.0, 4.0))))
    site.rig.clock.sleep(SILENT)
    site.expect_stands(2.0, "the newest stamp lies a minute in the future")
    site.rig.sensing = True
    site.expect_outcome(handle.wait(30.0), ExePathOutcome.SUCCESS)


@situation(shutdown_costmaps=True, shutdown_costmaps_delay=1.0)
def an_idle_map_stops_and_the_next_goal_gets_a_fresh_one(site: Site) -> None:
    """With shutdown_costmaps a map without goals is updated no more, until the next goal or question needs it."""
    site.rig.clock.sleep(2.0)
    site.rig.boxes = [WALL]
    site.rig.clock.sleep(1.0)
    idle = site.map.point_check()(FACE).state
    site.expect(idle in (CellState.FREE, CellState.UNKNOWN), f"the idle map has been updated: it is {idle.name}")
    site.expect_outcome(site.navigator.get_path(FACE, dist_tolerance=0.0), GetPathOutcome.BLOCKED_GOAL)
    site.expect_state(FACE, CellState.LETHAL)
    site.expect_outcome(site.navigator.go_to(somewhere(2.5, 6.0)), MoveBaseOutcome.SUCCESS)
