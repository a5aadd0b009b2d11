"""What all actions share: slots, preemption, handles in three styles, callbacks, closing; F-numbers are facts."""

import asyncio
import gc
import weakref
from dataclasses import replace

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import GetPathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.outcomes import GetPathOutcome as Outcome
from mbf_abstract.plugins import PlanResult, PluginKind
from mbf_abstract.testing.faulty import Hang, obedient, slow
from mbf_abstract.testing.scripted import ScriptedPlanner, straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock

TARGET = Pose.planar(3.0, 0.0)
CANCELED = PlanResult(Outcome.CANCELED, "as ordered")


def planners(count):
    return {f"p{i}": ScriptedPlanner for i in range(count)}


def send(session, planner="", slot=0):
    return session.navigator.send(GetPathGoal(TARGET, planner=planner, concurrency_slot=slot))


def busy(session, seconds=5.0):
    """Make every planner take its time, but obey."""
    for name in session.server.plugins.names(PluginKind.PLANNER):
        session.plugin(name, ScriptedPlanner).play(obedient(session.clock, seconds, straight_plan, CANCELED))


# ---------------------------------------------------------------------------------------------------- slots
def test_a_new_goal_in_a_used_slot_preempts_and_waits_its_turn(make_session):
    session = make_session()
    busy(session, 1.0)
    first = send(session)
    session.clock.sleep(0.5)
    second = send(session)
    assert second.status is GoalStatus.PENDING
    assert second.wait().success
    assert (first.status, first.result.message) == (GoalStatus.CANCELED, "preempted by a new goal")


def test_only_the_newest_goal_waits_for_its_slot(make_session):
    session = make_session()
    session.planner.play(slow(session.clock, 1.0, straight_plan))
    first = send(session)
    session.clock.sleep(0.5)
    second, third = send(session), send(session)
    assert second.status is GoalStatus.CANCELED
    assert second.result.message == "preempted by a new goal before it started"
    assert third.wait().success
    assert first.status is GoalStatus.CANCELED


def test_goals_in_different_slots_run_in_parallel(make_session):
    session = make_session(planners(4), planner_patience=0.0)
    busy(session, 2.0)
    handles = [send(session, f"p{i}", i) for i in range(4)]
    session.clock.sleep(1.0)
    assert [handle.status for handle in handles] == [GoalStatus.ACTIVE] * 4  # F242
    assert all(handle.wait().success for handle in handles)
    assert session.clock.now() == pytest.approx(2.0)


def test_f244_goals_end_each_with_its_own_result(make_session):
    session = make_session(planners(4), planner_max_retries=0)
    for i in range(4):
        answer = straight_plan if i % 2 else PlanResult(Outcome.BLOCKED_GOAL, f"number {i}")
        session.plugin(f"p{i}", ScriptedPlanner).play(slow(session.clock, 0.1 * (i + 1), answer))
    handles = [send(session, f"p{i}", i) for i in range(4)]
    results = [handle.wait() for handle in reversed(handles)]
    assert [result.outcome for result in results] == [0, Outcome.BLOCKED_GOAL, 0, Outcome.BLOCKED_GOAL]
    assert results[1].message == "number 2"


def test_f243_feedback_reaches_the_handle_it_was_published_for(make_session):
    session = make_session(planners(4), planner_patience=0.0)
    busy(session, 2.0)
    handles = [send(session, f"p{i}", i) for i in range(4)]
    session.clock.sleep(0.5)
    heard = []
    for number, handle in enumerate(handles):
        handle.add_feedback_callback(lambda feedback, number=number: heard.append((number, feedback)))
    for number, handle in reversed(list(enumerate(handles))):
        handle.publish_feedback(number + 1)
    session.clock.sleep(0.1)
    assert heard == [(3, 4), (2, 3), (1, 2), (0, 1)]
    assert [handle.feedback for handle in handles] == [1, 2, 3, 4]
    assert {handle.status for handle in handles} == {GoalStatus.ACTIVE}


def test_f290_cancel_all_ends_ten_running_slots(make_session):
    session = make_session(planners(10), planner_patience=0.0)
    busy(session, 100.0)
    handles = [send(session, f"p{i}", i) for i in range(10)]
    session.clock.sleep(1.0)
    session.navigator.cancel_all()
    session.clock.sleep(0.1)
    assert {handle.status for handle in handles} == {GoalStatus.CANCELED}
    assert not session.server.get_path.busy


def test_f289_ten_goals_sent_without_waiting_are_safe(make_session):
    session = make_session()
    handles = [send(session) for _ in range(10)]
    session.clock.sleep(1.0)
    assert [handle.status for handle in handles[:-1]] == [GoalStatus.CANCELED] * 9
    assert handles[-1].status is GoalStatus.SUCCEEDED
    for _ in range(10):
        session.navigator.cancel_all()


def test_sending_never_waits_also_when_the_running_plugin_hangs(make_session):
    session = make_session(planner_patience=1.0, cancel_grace=0.5)
    hang = Hang(session.clock, then=CANCELED)
    session.planner.play(hang)
    first = send(session)
    session.clock.sleep(0.1)
    second = send(session)
    assert session.clock.now() == pytest.approx(0.1)
    assert first.wait().outcome == Outcome.CANCELED
    assert session.clock.now() == pytest.approx(0.6)
    hang.release()
    session.planner.play(straight_plan)
    assert second.wait().success


# --------------------------------------------------------------------------------------------------- handles
def test_f239_to_f241_a_goal_succeeds_aborts_or_is_rejected_with_a_text(make_session):
    session = make_session(planner_max_retries=0)
    succeeded = send(session)
    succeeded.wait()
    session.planner.play(PlanResult(Outcome.FAILURE, "aborted by the planner"))
    aborted = send(session)
    aborted.wait()
    rejected = send(session, "nobody")
    assert [h.status.name for h in (succeeded, aborted, rejected)] == ["SUCCEEDED", "ABORTED", "REJECTED"]
    assert all(handle.result.message for handle in (succeeded, aborted, rejected))
    assert repr(aborted) == "<get_path goal 2, aborted: FAILURE>"


def test_f245_a_plugins_own_code_and_text_arrive_with_success_and_with_failure(make_session):
    session = make_session(planner_max_retries=0)
    session.planner.play(lambda request: replace(straight_plan(request), outcome=4, message="42"))
    succeeded = send(session).wait()
    session.planner.play(PlanResult(74, "42"))
    aborted = send(session).wait()
    assert (succeeded.outcome, succeeded.message) == (4, "42")
    assert (aborted.outcome, aborted.message) == (74, "42")


def test_f246_a_canceled_goal_keeps_the_last_words_of_its_plugin(make_session):
    session = make_session()
    busy(session, 100.0)
    handle = send(session)
    session.clock.sleep(1.0)
    handle.cancel()
    result = handle.wait()
    assert (handle.status, result.outcome) == (GoalStatus.CANCELED, Outcome.CANCELED)
    assert (result.plugin_outcome, result.plugin_message) == (Outcome.CANCELED, "as ordered")  # F288


def test_f247_a_plugin_that_raises_aborts_its_goal(make_session):
    session = make_session()
    session.planner.play(RuntimeError("no"))
    handle = send(session)
    handle.wait()
    assert handle.status is GoalStatus.ABORTED


def test_f248_f261_a_plan_that_succeeds_after_the_cancel_is_dropped_before_patience(make_session):
    session = make_session()
    session.planner.play(slow(session.clock, 0.5, straight_plan))
    handle = send(session)
    session.clock.sleep(0.1)
    handle.cancel()
    assert handle.wait().outcome == Outcome.CANCELED


def test_f250_a_cancel_without_any_goal_is_no_error(make_session):
    session = make_session()
    session.navigator.cancel_all()
    assert send(session).wait().success


# F251 to F262: the goal state machine
def test_f251_to_f257_a_goal_goes_from_pending_over_active_and_canceling_to_its_end(make_session):
    session = make_session()
    busy(session)
    handle = send(session)
    seen = [handle.status]
    session.clock.sleep(0.1)
    seen.append(handle.status)
    handle.cancel()
    seen.append(handle.status)
    handle.wait()
    seen.append(handle.status)
    assert [status.value for status in seen] == ["pending", "active", "canceling", "canceled"]


@pytest.mark.parametrize(
    ("canceled", "answer", "end"),
    [
        pytest.param(False, straight_plan, GoalStatus.SUCCEEDED, id="F254"),
        pytest.param(False, RuntimeError("no"), GoalStatus.ABORTED, id="F255"),
        pytest.param(True, RuntimeError("no"), GoalStatus.ABORTED, id="F257"),
    ],
)
def test_the_end_of_a_goal_that_ran(make_session, canceled, answer, end):
    session = make_session()
    session.planner.play(slow(session.clock, 0.5, answer))
    handle = send(session)
    session.clock.sleep(0.1)
    if canceled:
        handle.cancel()
    handle.wait()
    assert handle.status is end


def test_f258_a_pending_goal_can_only_be_canceled_before_it_runs(make_session):
    session = make_session()
    session.planner.play(slow(session.clock, 1.0, straight_plan))
    send(session)
    waiting = send(session)
    waiting.cancel()
    assert (waiting.status, waiting.result) == (GoalStatus.PENDING, None)
    assert waiting.wait().message == "canceled by the client before it started"
    assert waiting.status is GoalStatus.CANCELED


def test_f259_an_active_goal_is_not_started_again(make_session):
    session = make_session()
    busy(session, 1.0)
    handle = send(session)
    session.clock.sleep(0.1)
    handle.activate()
    assert handle.status is GoalStatus.ACTIVE
    assert handle.wait().success
    assert len(session.planner.requests) == 1


def test_f260_a_canceling_goal_is_neither_started_nor_canceled_again(make_session):
    session = make_session()
    session.planner.play(slow(session.clock, 1.0, straight_plan))
    handle = send(session)
    session.clock.sleep(0.1)
    for attempt in (handle.cancel, handle.activate, handle.cancel, handle.pause, handle.resume):
        attempt()
        assert handle.status is GoalStatus.CANCELING
    handle.wait()
    assert len(session.recorded(EventKind.GOAL_CANCEL)) == 1


def test_f262_a_final_goal_changes_no_more(make_session):
    session = make_session()
    handle = send(session)
    result = handle.wait()
    for attempt in (handle.cancel, handle.pause, handle.resume, handle.activate):
        attempt()
    assert not handle.finish(GoalStatus.ABORTED, result)
    assert handle.status is GoalStatus.SUCCEEDED
    assert not handle.cancel_requested and not handle.paused
    assert len([e for e in session.recorded(EventKind.GOAL_FINISHED) if e.data["goal_id"] == handle.id]) == 1


def test_f287_waiting_with_a_timeout_leaves_the_goal_running(make_session):
    session = make_session()
    busy(session, 1.0)
    handle = send(session)
    with pytest.raises(TimeoutError, match=r"still active after 0\.5 s"):
        handle.wait(0.5)
    assert handle.result is None
    assert handle.wait().success


def test_done_callbacks_run_once_also_when_added_late(make_session):
    session = make_session()
    log = []
    handle = session.server.get_path.send(GetPathGoal(TARGET), on_done=lambda h: log.append(("sent", h.id)))
    handle.wait()
    handle.add_done_callback(lambda h: log.append(("late", h.id)))
    session.clock.sleep(0.1)
    assert log == [("sent", handle.id), ("late", handle.id)]


def test_a_callback_that_raises_or_blocks_harms_no_goal(make_session):
    session = make_session()
    log = []

    def raises(handle):
        raise ValueError("mine")

    def blocks(handle):
        session.clock.sleep(1e5)

    for callback in (raises, blocks, log.append):
        session.server.get_path.send(GetPathGoal(TARGET), on_done=callback).wait()
    session.clock.sleep(10.0)
    assert len(log) == 1
    assert send(session).wait().success


def test_a_callback_may_send_the_next_goal_and_wait_for_it(make_session):
    session = make_session()
    results = []
    session.server.get_path.send(
        GetPathGoal(TARGET), on_done=lambda handle: results.append(session.navigator.get_path(TARGET))
    )
    session.clock.sleep(1.0)
    assert results[0].success


def test_goals_can_be_awaited_several_at_once(make_session):
    session = make_session(planners(2), planner_patience=0.0)
    busy(session, 0.5)

    async def main():
        return await asyncio.gather(send(session, "p0", 0), send(session, "p1", 1))

    assert all(result.success for result in asyncio.run(main()))


def test_all_three_styles_work_on_the_wall_clock():
    with ScriptedSession(clock=WallClock()) as session:
        assert session.navigator.get_path(TARGET).success
        handle = send(session)
        assert handle.wait(10.0).success

        async def main():
            return await send(session)

        assert asyncio.run(main()).success


def test_a_goal_of_no_action_is_refused(make_session):
    with pytest.raises(TypeError, match="expected one of GetPathGoal"):
        make_session().navigator.send("home")


# --------------------------------------------------------------------------------------------------- closing
def test_closing_the_server_ends_every_goal_and_rejects_new_ones():
    session = ScriptedSession()
    busy(session, 100.0)
    running = send(session)
    session.clock.sleep(0.1)
    waiting = send(session)
    driving = session.navigator.send(MoveBaseGoal(TARGET))
    session.close()
    assert {h.status for h in (running, waiting, driving)} == {GoalStatus.CANCELED}
    assert waiting.result.message == "the server is shut down before it started"
    late = session.navigator.send(RecoveryGoal())
    assert (late.status, late.result.message) == (GoalStatus.REJECTED, "the server is shut down")
    assert set(session.clock.thread_names) == {"main"}
    session.server.close()


def test_too_many_hung_plugins_make_the_server_refuse_goals(make_session):
    session = make_session(planners(2), planner_patience=0.5, cancel_grace=0.1, max_quarantined=1)
    hang = Hang(session.clock, then=CANCELED)
    session.plugin("p0", ScriptedPlanner).play(hang)
    assert send(session, "p0").wait().outcome == Outcome.PAT_EXCEEDED
    refused = send(session, "p1")
    assert refused.status is GoalStatus.REJECTED
    assert "1 plugin calls hang" in refused.result.message
    hang.release()
    session.clock.sleep(0.1)
    assert send(session, "p1").wait().success


def test_a_goal_that_is_over_leaves_nothing_to_the_garbage_collector(make_session):
    session = make_session()
    gc.collect()
    gc.disable()
    try:
        over = send(session)
        over.wait()
        kept = weakref.ref(over)
        del over
        send(session).wait()  # the thread of the slot holds its last goal until the next comes
        session.clock.sleep(1.0)
        assert kept() is None
    finally:
        gc.enable()
