"""A controller that commands nothing that gets its robot anywhere notices it, and holds its limits on its path."""

import numpy as np
import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import AckermannCommand, Path, Twist
from mbf_abstract.maps.controllers.motion_limits import MotionLimits
from mbf_abstract.maps.controllers.standing import FORGOTTEN, Standing
from mbf_abstract.maps.controllers.tight_places import cannot_turn_ahead

PERIOD = 0.05
STANDS = Twist()


def stood(commands, speed=0.5, yaw_rate=1.0, period=PERIOD):
    """How long a controller says its robot has stood after it gave these commands, each for a period."""
    standing, now = Standing(), 0.0
    standing.time(now, speed, yaw_rate)
    for command in commands:
        standing.commanded(command)
        now += period
        seconds = standing.time(now, speed, yaw_rate)
    return seconds


@pytest.mark.parametrize(
    "pattern",
    [
        [STANDS],
        [None],
        [AckermannCommand(0.0, 0.4)],
        [Twist.planar(0.1), Twist.planar(-0.1)],
        [Twist.planar(wz=0.9), Twist.planar(wz=-0.9)],
        [Twist.planar(0.04, 0.0, 0.3), Twist.planar(-0.04, 0.0, -0.3)],
    ],
)
def test_a_robot_that_is_told_to_stand_or_to_tremble_stands(pattern):
    assert stood(pattern * (100 // len(pattern))) == pytest.approx(5.0)


@pytest.mark.parametrize(
    "command",
    [Twist.planar(0.1), Twist.planar(-0.1), Twist.planar(0.0, 0.1), Twist.planar(wz=0.6), AckermannCommand(-0.1, 0.2)],
)
def test_a_robot_that_is_told_to_creep_or_to_turn_does_not(command):
    assert stood([command] * 100) < 1.5


@pytest.mark.parametrize(
    "pattern", [[Twist.planar(wz=1.0)], [Twist.planar(wz=1.0)] * 20 + [Twist.planar(wz=-1.0)] * 20]
)
def test_a_robot_that_is_told_to_turn_round_and_round_at_one_place_stands(pattern):
    assert stood(pattern * (400 // len(pattern))) == pytest.approx(20.0 - 2.0 * np.pi, abs=0.6)


def test_a_robot_that_comes_away_may_turn_once_more():
    assert stood(([Twist.planar(wz=1.0)] * 100 + [Twist.planar(0.5)] * 5) * 5) < 1.5


def test_it_counts_from_where_the_robot_was_last_told_to_go():
    assert stood([Twist.planar(0.5)] * 100 + [STANDS] * 40) == pytest.approx(2.0, abs=0.3)


def test_a_slow_robot_gets_on_at_its_own_speed_and_one_that_may_not_drive_is_not_blamed():
    assert stood([Twist.planar(0.01)] * 100, speed=0.02, yaw_rate=0.1) < 1.5
    assert stood([STANDS] * 100, speed=0.0) == 0.0


def test_a_controller_that_was_not_asked_for_a_while_begins_anew():
    standing = Standing()
    standing.commanded(STANDS)
    assert [standing.time(t, 0.5, 1.0) for t in (0.0, 0.9, 0.9 + FORGOTTEN + 0.1, 3.0)] == [0.0, 0.9, 0.0, 1.0]


def test_commands_along_the_path_keep_their_arc_within_the_limits():
    limits = MotionLimits(slowest=-0.1, fastest=0.4, turning=1.0, gain=0.2, turn_gain=0.5)
    rng, still = np.random.default_rng(0), Twist()
    for vx, wz, now in zip(rng.uniform(-1, 1, 200), rng.uniform(-2, 2, 200), rng.uniform(-0.5, 0.5, 200), strict=True):
        measured = Twist.planar(now)
        held = limits.hold(Twist.planar(vx, 0.0, wz), measured)
        assert -0.1 - 1e-9 <= held.vx <= min(0.4, abs(now) + 0.2) + 1e-9 and abs(held.wz) <= 0.5 + 1e-9
        assert held.wz * vx == pytest.approx(held.vx * wz) and held.vx * vx >= 0.0
    assert limits.hold(Twist.planar(0.1, 0.0, 0.2), still) == Twist.planar(0.1, 0.0, 0.2)


def test_only_a_cusp_or_an_end_near_ahead_where_no_turn_fits_is_narrow():
    tracker = PathTracker(Path.from_points([(x, 0.0, 0.0) for x in np.linspace(0.0, 3.0, 31)]), dimensions=2)

    def crosswise_is_blocked(poses):
        return not (np.abs(np.sin(poses[:, 2])) > 0.9).any()

    tracker.update((1.0, 0.0))
    assert not cannot_turn_ahead(tracker, 1.5, crosswise_is_blocked)
    tracker.update((1.6, 0.0))
    assert cannot_turn_ahead(tracker, 1.5, crosswise_is_blocked)
    assert not cannot_turn_ahead(tracker, 1.5, lambda poses: bool(poses.size))
