"""How long a robot plans that finds no path, and may wait for another robot that is announced; with its wish."""

from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.server.announcer import Announcer
from mbf_abstract.testing.faulty import obedient
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.traffic import SharedChannel

GOAL = Pose.planar(8.0, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "somebody stands there")
STOPPED = PlanResult(GetPathOutcome.CANCELED, "stopped")
BEN = Announcement("ben", 0.0, np.array([(6.5, 0.0, 0.0)]), 0.0, radius=0.2, makes_room=True)
PATIENCE = 5.0


@pytest.fixture
def plan(make_session):
    """``plan(retries, failing, wishing)``: how long [s] a call that fails takes, and a wish; what came of it."""

    def make(retries, failing, wishing, ben=BEN):
        session, channel = make_session(planner_max_retries=retries, planner_patience=PATIENCE), SharedChannel()
        Announcer(session.server, "anna", channel).announce()

        def no_path(request):
            channel.publish(replace(ben, stamp=session.clock.now()))
            return obedient(session.clock, failing, NO_PATH, STOPPED)(request)

        def forget(places):
            session.planner.play(obedient(session.clock, wishing, straight_plan, STOPPED))

        channel.publish(ben)
        session.server.forget, session.wished = forget, lambda: session.server.runtime.traffic.wished is not None
        session.planner.play(no_path)
        begun = session.clock.now()
        result = session.navigator.send(GetPathGoal(GOAL)).wait()
        return session, result, session.clock.now() - begun

    return make


def test_retries_without_end_leave_time_for_a_wish(plan):
    session, result, seconds = plan(-1, failing=1.0, wishing=1.0)
    assert session.wished() and seconds < PATIENCE
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND and result.path is None


def test_a_plan_and_its_wish_take_one_and_a_half_times_the_patience_at_most(plan):
    session, result, seconds = plan(0, failing=0.98 * PATIENCE, wishing=10.0)
    assert not session.wished() and result.outcome == GetPathOutcome.NO_PATH_FOUND
    assert seconds < 1.5 * PATIENCE + 0.1


def test_a_wish_has_what_a_short_plan_leaves_of_the_patience(plan):
    session, _, seconds = plan(0, failing=0.1 * PATIENCE, wishing=0.8 * PATIENCE)
    assert session.wished() and seconds < PATIENCE


def test_where_nobody_may_leave_the_planner_has_all_of_the_patience(plan):
    session, result, seconds = plan(-1, failing=1.0, wishing=1.0, ben=replace(BEN, cannot_yield=True))
    assert not session.wished() and seconds > 0.99 * PATIENCE
    assert result.outcome == GetPathOutcome.PAT_EXCEEDED
