"""Pausing all goals and resuming one: the parts of a move_base goal follow it, whoever else has paused them."""

from itertools import product

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.plugins import RecoveryResult
from mbf_abstract.testing.faulty import slow
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock

GOAL = MoveBaseGoal(Pose.planar(0.5, 0.0))


def recovering(session):
    session.planner.play(RuntimeError("no"), straight_plan)
    session.recovery.play(slow(session.clock, 0.3, RecoveryResult(0, "")))


def planning(session):
    session.planner.play(slow(session.clock, 0.3, straight_plan))


def following(session):
    pass


PHASES = [planning, following, recovering]


@pytest.mark.parametrize(("phase", "clock"), product(PHASES, [SimClock, WallClock]))
def test_a_move_base_goal_resumed_after_pausing_all_goes_on(make_session, phase, clock):
    session = make_session(clock=clock())
    phase(session)
    handle = session.navigator.send(GOAL)
    session.clock.sleep(0.15)
    for _ in range(5):
        session.server.pause_all()
        handle.resume()
    assert handle.wait(20.0).success


@pytest.mark.parametrize("phase", PHASES)
def test_resumed_part_by_part_in_any_order_it_stays_as_its_own_handle_says(make_session, phase):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        session = make_session(clock=SimClock(schedule=rng))
        phase(session)
        handle = session.navigator.send(GOAL)
        session.clock.sleep(float(rng.choice([0.0, 0.1, 0.2])))
        for _ in range(6):
            parts = [handle, *session.server.get_path.unfinished, *session.server.exe_path.unfinished]
            part = parts[rng.integers(len(parts))]
            [part.pause, part.resume, session.server.pause_all, session.server.resume_all][rng.integers(4)]()
            session.clock.sleep(float(rng.choice([0.0, 0.01, 0.1])))
        session.clock.sleep(0.1)
        if handle.paused:
            here = session.robot.pose
            session.clock.sleep(2.0)
            assert handle.status is GoalStatus.PAUSED
            assert session.robot.pose.position == here.position
        handle.resume()
        assert handle.wait(20.0).success, seed
        session.close()
