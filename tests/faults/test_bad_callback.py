"""Fault table, row 20: callbacks of the user that raise or block."""

import asyncio

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal
from mbf_abstract.testing.faulty import Hang
from mbf_abstract.testing.scripted_session import ScriptedSession


def test_a_raising_callback_harms_neither_the_goal_nor_the_others():
    def bad(*arguments):
        raise RuntimeError("user code")

    with ScriptedSession() as session:
        seen = []
        handle = session.navigator.send(ExePathGoal(session.path_to(1.0)))
        handle.add_feedback_callback(bad)
        handle.add_feedback_callback(seen.append)
        handle.add_done_callback(bad)
        assert handle.wait().success
        session.clock.sleep(0.1)
        faults = [
            event for event in session.recorded(EventKind.FAULT) if "user callback raised" in event.data["message"]
        ]
        assert len(faults) > 10
        assert len(seen) > 10


def test_a_blocking_callback_is_left_alone_and_the_others_are_served():
    with ScriptedSession() as session:
        hang, seen = Hang(session.clock), []
        handle = session.navigator.send(ExePathGoal(session.path_to(5.0)))
        handle.add_feedback_callback(seen.append)
        first = session.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0)))
        first.add_done_callback(hang)
        session.clock.sleep(4.0)
        assert hang.entered == 1
        served_before = len(seen)
        assert handle.wait().success
        session.clock.sleep(6.0)
        assert len(seen) > served_before
        assert any("blocked" in event.data["message"] for event in session.recorded(EventKind.FAULT))
        hang.release()


def test_behind_a_slow_feedback_callback_no_end_is_lost_and_the_order_of_each_goal_is_kept():
    with ScriptedSession() as session:
        log = []

        def slow(feedback):
            session.clock.sleep(0.5)
            log.append(("feedback", round(feedback.dist_to_goal, 1)))

        driving = session.navigator.send(ExePathGoal(session.path_to(3.0)))
        driving.add_feedback_callback(slow)
        driving.add_done_callback(lambda handle: log.append(("end", handle.id)))
        handles = [driving]
        for _ in range(1500):
            handles.append(session.server.get_path.send(GetPathGoal(Pose.planar(1.0, 0.0))))
            handles[-1].add_done_callback(lambda handle: log.append(("end", handle.id)))
        assert driving.wait().success
        session.clock.sleep(2.0)
        assert sorted(end for what, end in log if what == "end") == [handle.id for handle in handles]
        ends = [index for index, entry in enumerate(log) if entry == ("end", driving.id)]
        distances = [(index, distance) for index, (what, distance) in enumerate(log) if what == "feedback"]
        assert 10 < len(distances) < 25  # it took as many as it had time for, each time the newest
        assert [distance for _, distance in distances] == sorted((d for _, d in distances), reverse=True)
        assert distances[-1][0] < ends[0]


def test_a_callback_that_exits_stops_no_other_callback():
    def leave(*arguments):
        raise SystemExit(1)

    with ScriptedSession() as session:
        log = []
        for number in range(10):
            handle = session.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0)))
            handle.add_done_callback(leave)
            handle.add_done_callback(lambda handle, number=number: log.append((number, session.clock.now())))
            handle.wait()
        session.clock.sleep(0.1)
        assert log == [(number, 0.0) for number in range(10)]


def test_callbacks_run_although_the_server_is_closed_right_after_or_before_the_end():
    log = []
    with ScriptedSession() as session:
        ended = session.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0)))
        ended.add_done_callback(lambda handle: log.append("ended"))
        ended.wait()
        session.server.close()
        ended.add_done_callback(lambda handle: log.append("added after the close"))
    with ScriptedSession() as session:
        running = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        running.add_done_callback(lambda handle: log.append(handle.status.value))
        session.clock.sleep(1.0)
    assert log == ["ended", "added after the close", "canceled"]


def test_a_goal_is_awaited_past_a_blocked_callback():
    async def main(handle):
        return await handle

    with ScriptedSession() as session:
        hang = Hang(session.clock)
        session.server.runtime.callbacks._patience = float("inf")
        first = session.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0)))
        first.add_done_callback(hang)
        first.wait()
        session.clock.sleep(0.1)
        assert asyncio.run(main(session.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0))))).success
        assert (hang.entered, hang.left) == (1, 0)
        hang.release()
