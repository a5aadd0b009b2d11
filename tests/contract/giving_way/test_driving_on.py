"""Who stood ahead of a robot that gives way drives on, as it had waited for somebody else: the robot stays."""

import math

import pytest

from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.outcomes import RecoveryOutcome
from tests.contract.giving_way.conftest import START, bay, hall

LONG_WAIT = {"wait": 30.0, "random_extra": 0.0}


def tracked(number, x, y, vx=0.0, vy=0.0):
    motion = Motion.MOVING if vx or vy else Motion.WAITING
    return TrackedObject(number, motion, x, y, 0.0, vx, vy, 0.3, 5.0, 0.0, 3.0, 0.0, "map")


@pytest.fixture
def behind(give_way, world):
    """``behind(after, vx, vy, others)``: one stands 1.2 m ahead, and drives off so many seconds later; others stand."""

    def run(after, vx=0.4, vy=0.0, others=(), lethal=hall, **parameters):
        seen, begun = world.map_of(lethal), []

        def objects(now):
            begun[:] = begun or [now]
            driven = max(now - begun[0] - after, 0.0)
            velocity = (vx, vy) if driven > 0.0 else (0.0, 0.0)
            return (tracked(1, 5.7 + vx * driven, 3.0 + vy * driven, *velocity), *others)

        seen.tracked_objects = objects
        return give_way(lethal, distance=0.6, navigation_map=seen, **LONG_WAIT, **parameters)

    return run


def away_from_path(motion):
    return abs(motion.end.y - START.y)


def test_a_robot_that_has_hardly_begun_to_pull_out_stops(behind):
    result, motion = behind(after=0.5)
    assert result.success and motion.seconds < 4.0 and "until who stood ahead drove on" in result.message
    assert math.hypot(motion.end.x - START.x, motion.end.y - START.y) < 0.5


def test_a_robot_that_stands_aside_waits_no_longer(behind):
    result, motion = behind(after=15.0)
    assert result.success and away_from_path(motion) > 0.5
    assert 15.0 < motion.seconds < 20.0


@pytest.mark.parametrize(("vx", "vy"), [(-0.1, 0.0), (0.0, 0.1), (-0.1, 0.1)])
def test_one_that_comes_or_crosses_is_given_way_to(behind, vx, vy):
    result, motion = behind(after=0.5, vx=vx, vy=vy)
    assert result.success and away_from_path(motion) > 0.5 and motion.seconds > 4.0


def test_one_that_stands_on_the_way_still_is_given_way_to(behind):
    result, motion = behind(after=0.5, others=(tracked(2, 6.3, 3.3),))
    assert result.success and away_from_path(motion) > 0.5


def test_who_was_never_seen_to_stand_there_ends_nothing(behind):
    """One that drives ahead of the robot from the beginning was not waited for."""
    result, motion = behind(after=-0.5)
    assert result.success and away_from_path(motion) > 0.5


def test_a_robot_in_a_bay_comes_no_sooner_than_it_can_turn_to_its_path(behind):
    """Half in the bay, or out of it: it never stands across the corridor's edge, where it could not go on."""
    result, motion = behind(after=1.0, lethal=bay(2.4, 3.4, True), reach=4.0)
    assert result.outcome == RecoveryOutcome.SUCCESS, result.message
    assert motion.least_gap > 0.15
