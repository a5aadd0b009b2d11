"""Recoveries drive a kinematic robot through the ``Motion`` protocol."""

import math

import numpy as np
import pytest

from mbf_abstract.maps.manoeuvres import Step
from mbf_abstract.maps.recoveries.back_up import BackUpRecovery
from mbf_abstract.maps.recoveries.clear import ClearRecovery
from mbf_abstract.maps.recoveries.drive_on_heading import DriveOnHeadingRecovery
from mbf_abstract.maps.recoveries.manoeuvre_recovery import ATTEMPTS, ManoeuvreParameters, ManoeuvreRecovery
from mbf_abstract.maps.recoveries.move_away import MoveAwayRecovery
from mbf_abstract.maps.recoveries.relax import RelaxRecovery
from mbf_abstract.maps.recoveries.rotate import RotateRecovery
from mbf_abstract.maps.recoveries.wait import WaitRecovery
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.motion_check import blocked_cells
from mbf_costmap_nav.recoveries.escape import EscapeRecovery

MOVING = [RotateRecovery, BackUpRecovery, DriveOnHeadingRecovery, EscapeRecovery, MoveAwayRecovery]


def around(*boxes):
    """10 m x 10 m around the origin at 0.05 m with lethal boxes (x0, y0, x1, y1) [m]."""
    cells = np.zeros((200, 200), dtype=np.uint8)
    for box in boxes:
        x0, y0, x1, y1 = (round((v + 5.0) / 0.05) for v in box)
        cells[y0:y1, x0:x1] = 254
    return Costmap(cells, 0.05, -5.0, -5.0)


@pytest.fixture
def run(make_plugin, closed_loop):
    """``run(Class, costmap, **parameters)`` -> (result, robot, plugin)."""

    def run(plugin_class, costmap=None, start=(0.0, 0.0, 0.0), token=None, on_sleep=None, **parameters):
        plugin = make_plugin(plugin_class, costmap or around(), **parameters)
        robot = closed_loop.robot(*start)
        robot.clock = plugin.clock
        if on_sleep:
            robot.on_sleep = on_sleep
        return plugin.run_behavior(RecoveryRequest(robot, token or CancelToken())), robot, plugin

    return run


def test_rotate_turns_a_full_revolution_and_stops(run):
    result, robot, _ = run(RotateRecovery)
    assert result.success
    assert abs(robot.state[2] - 2 * math.pi) < 0.15
    assert robot.commands[-1].is_stopped()


def test_rotate_to_the_right(run):
    _, robot, _ = run(RotateRecovery, angle=-1.0)
    assert robot.state[2] == pytest.approx(-1.0, abs=0.1)


def test_back_up_covers_the_distance_and_stops(run):
    result, robot, _ = run(BackUpRecovery, distance=0.5)
    assert result.success and robot.state[0] == pytest.approx(-0.5, abs=0.03)
    assert robot.commands[-1].is_stopped()


def test_back_up_stops_before_a_wall_behind(run):
    result, robot, _ = run(BackUpRecovery, around((-0.6, -1, -0.5, 1)), distance=1.0)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert robot.state[0] - 0.2 > -0.5
    assert "obstacle is in the way" in result.message


def test_rotate_stops_before_a_corner_would_sweep_a_wall(run):
    result, robot, _ = run(RotateRecovery, around((0.22, -1, 0.3, 1)))
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert abs(robot.state[2]) < 0.2


def test_a_robot_that_touches_a_wall_in_front_may_back_out(run):
    result, robot, _ = run(BackUpRecovery, around((0.15, -1, 0.3, 1)), distance=0.3)
    assert result.success and robot.state[0] < -0.25


@pytest.mark.parametrize(("recovery", "speed"), [(BackUpRecovery, -1.0), (DriveOnHeadingRecovery, 1.0)])
def test_no_recovery_drives_off_the_map(run, recovery, speed):
    result, robot, _ = run(recovery, start=(4.6 * speed, 0.0, 0.0), distance=1.0)
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert abs(robot.state[0]) < 5.0


@pytest.mark.parametrize("recovery", [RotateRecovery, BackUpRecovery, DriveOnHeadingRecovery, MoveAwayRecovery])
def test_wholly_on_obstacles_nothing_moves_but_escape(run, recovery):
    result, robot, _ = run(recovery, around((-3.0, -3.0, 3.0, 3.0)))
    assert result.outcome == RecoveryOutcome.IMPASSABLE
    assert robot.state[0] == robot.state[1] == robot.state[2] == 0.0


TOUCHING = (0.15, -1.0, 0.3, 1.0)  # a wall into which the front of the robot at the origin reaches


@pytest.mark.parametrize("recovery", [*MOVING, WaitRecovery, ClearRecovery, RelaxRecovery])
def test_a_token_set_before_is_honoured(run, recovery):
    token = CancelToken()
    token.cancel("no longer wanted")
    result, robot, _ = run(recovery, around(TOUCHING), token=token)
    assert result.outcome == RecoveryOutcome.CANCELED and "no longer wanted" in result.message
    assert all(command.is_stopped() for command in robot.commands)


@pytest.mark.parametrize("recovery", MOVING)
def test_cancel_while_moving_stops_the_robot(run, recovery):
    # Only who has something to flee moves beside a wall; the others would not leave at all there.
    world = around(TOUCHING) if recovery in (EscapeRecovery, MoveAwayRecovery) else around()
    token = CancelToken()
    result, robot, _ = run(recovery, world, token=token, on_sleep=token.cancel)
    assert result.outcome == RecoveryOutcome.CANCELED
    moving, stopped = robot.commands
    assert not moving.is_stopped() and stopped.is_stopped()


class Searching(ManoeuvreRecovery):
    """Leaves by manoeuvres that a test gives."""

    Parameters = ManoeuvreParameters

    def recover(self, request):
        self.searches = []
        return self.drive_out(request, lambda begin: self.searches.append(begin) or self.answer(request.cancel_token))


def test_a_manoeuvre_out_is_searched_a_few_times_and_a_result_ends_it(run):
    class Short(Searching):
        def answer(self, token):
            return [Step(1, ((0.1, 0.0, 0.0), (0.2, 0.0, 0.0)), 0.2)]

    result, robot, plugin = run(Short)
    assert result.success and len(plugin.searches) == ATTEMPTS
    assert robot.state[0] == pytest.approx(ATTEMPTS * 0.2, abs=0.05 * ATTEMPTS)

    class Nowhere(Searching):
        def answer(self, token):
            return RecoveryResult(RecoveryOutcome.IMPASSABLE, "nowhere")

    result, _, plugin = run(Nowhere)
    assert (result.outcome, result.message, len(plugin.searches)) == (RecoveryOutcome.IMPASSABLE, "nowhere", 1)


@pytest.mark.parametrize(
    ("found", "end"),
    [(RecoveryOutcome.SUCCESS, RecoveryOutcome.SUCCESS), (RecoveryOutcome.IMPASSABLE, RecoveryOutcome.CANCELED)],
)
def test_a_search_that_is_cut_short_by_a_cancel_has_not_found_that_nothing_leads_out(run, found, end):
    class CutShort(Searching):
        def answer(self, token):
            token.cancel("no longer wanted")
            return RecoveryResult(found)

    assert run(CutShort)[0].outcome == end


@pytest.mark.parametrize(
    ("recovery", "boxes"),
    [
        (RotateRecovery, [(0.22, -1.0, 0.3, 1.0)]),
        (BackUpRecovery, [(-0.35, -1.0, -0.3, 1.0)]),
        (DriveOnHeadingRecovery, [(0.3, -1.0, 0.35, 1.0)]),
        (EscapeRecovery, [TOUCHING, (-0.35, -1.0, -0.3, 1.0)]),
        (MoveAwayRecovery, [(0.25, -1.0, 0.3, 1.0), (-0.35, -1.0, -0.3, 1.0)]),
    ],
)
def test_no_recovery_drives_into_what_stands_in_its_way(run, closed_loop, recovery, boxes):
    world = around(*boxes)
    _, robot, plugin = run(recovery, world)
    footprint = plugin.navigation_map.footprint
    deepest = max(blocked_cells(world, footprint, *state)[0] for state in robot.trace)
    assert deepest <= blocked_cells(world, footprint, 0.0, 0.0, 0.0)[0]


def test_a_robot_that_does_not_move_runs_into_the_time_limit(run, make_plugin, closed_loop):
    plugin = make_plugin(BackUpRecovery, around(), time_limit=1.0)
    robot = closed_loop.robot(0, 0, 0, linear_accel=0.0)
    robot.clock = plugin.clock
    result = plugin.run_behavior(RecoveryRequest(robot))
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED and "not done after 1 s" in result.message


def test_wait_takes_its_time(run):
    result, _, plugin = run(WaitRecovery, duration=2.0)
    assert result.success and plugin.clock.now() == pytest.approx(2.0)


def test_clear_resets_both_maps(run):
    result, _, plugin = run(ClearRecovery)
    assert result.success and plugin.navigation_map.cleared == ["all", "all"]


def test_clear_around_the_robot_on_one_map(run):
    result, _, plugin = run(ClearRecovery, costmaps="local", radius=1.5)
    assert result.success and plugin.navigation_map.cleared == ["area 3"]


def test_drive_on_heading_goes_the_distance_along_the_heading(run):
    result, robot, _ = run(DriveOnHeadingRecovery, start=(0, 0, math.pi / 2), distance=0.5)
    assert result.success and robot.state[:2] == pytest.approx((0.0, 0.5), abs=0.03)


def test_escape_backs_out_of_an_obstacle_in_front(run):
    result, robot, _ = run(EscapeRecovery, around((0.15, -1, 0.3, 1)), free_cost=254)
    assert result.success and robot.state[0] + 0.2 < 0.15


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.4), (0.0, 0.03, -0.7)])
@pytest.mark.parametrize("behind", [[], [(-0.5, -1, -0.3, 1)], [(-0.5, -1, -0.22, 1)]])
def test_escape_turns_no_car_on_the_spot(run, behind, start):
    result, robot, _ = run(EscapeRecovery, around((0.1, 0.1, 0.3, 0.3), *behind), start=start, turning_radius=0.6)
    assert result.success or (behind and result.outcome == RecoveryOutcome.IMPASSABLE), result.message
    assert all(abs(command.wz) * 0.6 <= abs(command.vx) + 1e-9 for command in robot.commands)


def test_escape_does_nothing_where_nothing_is_wrong(run):
    result, robot, _ = run(EscapeRecovery)
    assert result.success and robot.state.tolist() == [0.0, 0.0, 0.0]


def test_escape_says_that_it_cannot_get_out(run):
    walled = around((-1, -1, 1, 1))
    result, robot, _ = run(EscapeRecovery, walled)
    assert result.outcome == RecoveryOutcome.IMPASSABLE and robot.commands[-1].is_stopped()


def test_move_away_gains_the_clearance(run):
    result, robot, _ = run(MoveAwayRecovery, around((0.3, -0.1, 0.4, 0.1)), clearance=0.6)
    assert result.success and 0.3 - robot.state[0] >= 0.55


def test_move_away_sideways_needs_an_omnidirectional_robot_or_one_that_turns(run):
    wall = around((-1, 0.3, 1, 0.4))
    result, robot, _ = run(MoveAwayRecovery, wall, yaw_rate=0.0)
    assert result.outcome == RecoveryOutcome.IMPASSABLE and robot.state[2] == 0.0
    result, robot, _ = run(MoveAwayRecovery, wall)
    assert result.success and robot.state[1] < -0.2
    result, robot, _ = run(MoveAwayRecovery, wall, omnidirectional=True)
    assert result.success and robot.state[1] < -0.2


def uniform(cost):
    """5 m x 5 m at 0.05 m of one cost, around the origin."""
    return Costmap(np.full((100, 100), cost, dtype=np.uint8), 0.05, -2.5, -2.5)


def test_escape_does_not_take_the_end_of_the_map_for_a_way_out(run):
    for cost in (253, 254):
        result, robot, _ = run(EscapeRecovery, uniform(cost), start=(2.4, 0.0, 0.0))
        assert result.outcome == RecoveryOutcome.IMPASSABLE
        assert robot.state[0] < 2.5


def test_escape_comes_back_onto_the_map(run):
    result, robot, _ = run(EscapeRecovery, uniform(0), start=(2.6, 0.0, 0.0))
    assert result.success and robot.state[0] + 0.2 < 2.5
    result, _, _ = run(EscapeRecovery, uniform(0), start=(4.0, 0.0, 0.0))
    assert result.outcome == RecoveryOutcome.IMPASSABLE and "off the map" in result.message


@pytest.mark.parametrize("free_cost", [100, 253])
def test_escape_sees_no_collision_on_unknown_ground(run, free_cost):
    result, robot, _ = run(EscapeRecovery, uniform(255), free_cost=free_cost)
    assert result.success and robot.state.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("x", [-0.08, 0.0, 0.03])
@pytest.mark.parametrize("yaw", [0.0, 0.3])
def test_move_away_ends_between_two_obstacles_where_the_clearance_is_best(run, x, yaw):
    walls = around((-0.55, -2.0, -0.5, 2.0), (0.5, -2.0, 0.55, 2.0))
    result, robot, plugin = run(MoveAwayRecovery, walls, start=(x, 0.0, yaw), clearance=0.8)
    assert result.outcome == RecoveryOutcome.IMPASSABLE and "cannot move away" in result.message
    assert abs(robot.state[0]) < 0.05 and plugin.clock.now() < 3.0
