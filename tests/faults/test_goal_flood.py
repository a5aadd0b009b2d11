"""Fault table, rows 17 and 18: floods of goals, and leaks."""

import gc
import threading
import weakref

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.testing.faulty import Hang
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_next_goals_work

GOAL = GetPathGoal(Pose.planar(1.0, 0.0))


def test_of_a_flood_one_goal_runs_one_waits_and_the_rest_end_with_a_reason():
    with ScriptedSession(planner_patience=0.0) as session:
        hang = Hang(session.clock, then=straight_plan)
        session.planner.play(hang)
        handles = [session.navigator.send(GOAL) for _ in range(1)]
        session.clock.sleep(0.0)
        handles += [session.navigator.send(GOAL) for _ in range(2000)]
        ended = [handle for handle in handles if handle.done]
        assert hang.entered == 1
        assert len(handles) - len(ended) <= 2
        assert {handle.status for handle in ended} == {GoalStatus.CANCELED}
        assert all(handle.result.outcome == GetPathOutcome.CANCELED and handle.result.message for handle in ended)
        hang.release()
        assert handles[-1].wait().success
        assert_next_goals_work(session)


def test_1000_goals_leave_no_thread_and_no_handle_behind():
    with ScriptedSession() as session:
        session.navigator.get_path(GOAL.target_pose)
        threads = threading.active_count()
        handles = []
        for _ in range(1000):
            handle = session.navigator.send(GOAL)
            handle.wait()
            handles.append(weakref.ref(handle))
        del handle
        session.planner.requests.clear()
        session.clock.sleep(1.0)
        gc.collect()
        assert threading.active_count() <= threads
        assert sum(reference() is not None for reference in handles) <= 2
