"""The stuck monitor: the same failure at the same place is counted, whatever happens in between."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.actions.stuck_monitor import StuckMonitor
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.faulty import Hang
from mbf_abstract.testing.scripted_session import ScriptedSession

BLOCKED, COLLISION, MISSED = ExePathOutcome.BLOCKED_PATH, ExePathOutcome.COLLISION, ExePathOutcome.MISSED_PATH
STUCK = ExePathOutcome.ROBOT_STUCK
LADDER = ("wait", "back_out")


class Stand:
    """A monitor and a robot that is put somewhere before each failure."""

    def __init__(self, session, escalation=()):
        self.session = session
        self.monitor = StuckMonitor(session.server.runtime, session.server.plugins)
        self.monitor.restart(escalation)

    def fail(self, x=0.0, outcome=BLOCKED):
        self.session.robot._x = x
        self.session.clock.sleep(0.05)  # for its pose to be published
        self.monitor.note_failure(outcome)
        return self.monitor.stuck

    def replace_path(self, x, length):
        """Whether a path of this length is a setback too many, where 5 m were left."""
        self.session.robot._x = x
        self.session.clock.sleep(0.05)
        return bool(self.monitor.note_new_path(length, 5.0))


@pytest.fixture
def stand():
    """``stand(escalation, **parameters)``; its session is closed at the end."""
    sessions = []

    def make(escalation=(), **parameters):
        sessions.append(ScriptedSession(**{"stuck_time": 0.0, **parameters}))
        return Stand(sessions[-1], escalation)

    yield make
    for session in sessions:
        session.close()


@pytest.mark.parametrize("end", ["INTERNAL_ERROR", "PAT_EXCEEDED"])
def test_a_recovery_that_raises_or_hangs_is_named_at_the_end_of_its_goal(end):
    with ScriptedSession(planner_max_retries=0, recovery_patience=1.0) as session:
        hang = Hang(session.clock)
        session.planner.play(PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in"))
        session.recovery.play(hang if end == "PAT_EXCEEDED" else ValueError("no idea"))
        result = session.navigator.go_to(Pose.planar(3.0, 0.0))
        hang.release()
    assert result.message == f"walled in; tried recovery ({end})"


def test_the_third_failure_of_one_kind_at_one_place_is_one_too_many(stand):
    made = stand()
    assert [made.fail() for _ in range(4)] == [False, False, True, True]


def test_failures_in_quick_succession_are_one_too_many_only_after_a_time(stand):
    """A controller that fails at once beside a robot that passes is not stuck yet."""
    made = stand(stuck_time=2.0)
    quick = [made.fail() for _ in range(20)]  # 0.05 s between two
    made.session.clock.sleep(1.5)
    assert not any(quick) and made.fail()


def test_failures_of_different_kinds_are_counted_apart(stand):
    made = stand()
    codes = (BLOCKED, MISSED, BLOCKED, MISSED, BLOCKED)
    assert [made.fail(outcome=code) for code in codes] == [False, False, False, False, True]


def test_a_robot_that_comes_to_touch_what_is_in_its_way_is_as_blocked_as_before(stand):
    made = stand()
    assert [made.fail(outcome=code) for code in (BLOCKED, COLLISION, BLOCKED)] == [False, False, True]


def test_what_the_robot_did_between_two_failures_does_not_matter(stand):
    made = stand(stuck_distance=0.5)
    places = [0.0, 3.0, 0.2, 3.1, 0.4, 2.9]
    assert [made.fail(x) for x in places] == [False, False, False, False, True, True]


def test_a_failure_beyond_the_distance_is_at_another_place(stand):
    made = stand(stuck_distance=0.5)
    assert [made.fail(x) for x in (0.0, 0.45, 0.6, 0.9, 0.1)] == [False, False, False, False, True]


def test_a_limit_of_zero_switches_the_monitor_off(stand):
    made = stand(LADDER, stuck_failures=0)
    assert not any(made.fail() for _ in range(20))
    assert not made.session.recorded(EventKind.STUCK)


def test_a_new_goal_begins_with_nothing_counted(stand):
    made = stand(LADDER)
    for _ in range(3):
        made.fail()
    made.monitor.restart(LADDER)
    assert not made.monitor.stuck
    assert not made.fail()


def test_a_robot_that_is_lost_is_stuck_nowhere(stand):
    made = stand(stuck_failures=1, tf_timeout=0.5)
    assert made.fail()
    made.session.robot.publishes_pose = False
    made.session.clock.sleep(1.0)
    made.monitor.note_failure(BLOCKED)
    assert not made.monitor.stuck
    assert made.monitor.described("lost") == "lost"


def test_it_is_reported_once_with_place_kind_and_what_was_tried(stand):
    made = stand()
    for name, end in (("clear", 0), ("back_up", RecoveryOutcome.IMPASSABLE), ("clear", 0), ("clear", 0)):
        made.fail(10.7)
        made.monitor.note_recovery(name, end)
    (event,) = made.session.recorded(EventKind.STUCK)
    assert event.data["place"] == [10.7, 0.0, 0.0]
    assert (event.data["outcome"], event.data["failures"]) == (BLOCKED, 3)
    assert event.data["tried"] == ["clear", "back_up"]
    expected = "stuck at (10.70, 0.00): BLOCKED_PATH 3 times; tried clear, back_up (IMPASSABLE)"
    assert event.data["message"] == expected
    assert made.monitor.described("a chair") == f"a chair; {expected.replace('3', '4')}"


def test_the_message_of_a_robot_that_is_not_stuck_stays(stand):
    made = stand()
    made.fail()
    assert made.monitor.described("a chair") == "a chair"


def test_a_place_above_the_ground_is_named_with_its_height(stand):
    made = stand(start=Pose.planar(1.0, 2.0, 0.0, 3.5), stuck_failures=1)
    made.monitor.note_failure(GetPathOutcome.NO_PATH_FOUND)
    assert made.monitor.described("x") == "x; stuck at (1.00, 2.00, 3.50): NO_PATH_FOUND 1 times; tried nothing"


def test_each_behaviour_of_the_escalation_is_due_once_at_each_place(stand):
    made = stand(LADDER)
    made.fail(0.0)
    assert [made.monitor.next_behavior() for _ in range(3)] == ["wait", "back_out", ""]
    made.fail(5.0)
    assert made.monitor.next_behavior() == "wait"
    made.fail(0.1)
    assert made.monitor.next_behavior() == ""


def test_without_escalation_the_usual_recoveries_go_on(stand):
    made = stand(())
    for _ in range(5):
        made.fail()
    assert made.monitor.stuck and not made.monitor.escalates
    assert made.monitor.next_behavior() == ""


@given(
    st.lists(st.tuples(st.integers(0, 40), st.sampled_from([BLOCKED, COLLISION, MISSED])), max_size=30),
    st.integers(0, 4),
    st.integers(0, 12),
    st.sampled_from([0.0, 0.5]),
)
def test_it_counts_as_a_naive_counter_does(failures, limit, tenths, wait):
    """The twin keeps the whole history: a failure belongs to the first place ever founded within the distance."""
    parameters = {"stuck_failures": limit, "stuck_distance": tenths / 10.0, "stuck_time": wait}
    with ScriptedSession(**parameters) as session:
        made = Stand(session)
        founded, history, stuck = [], [], set()
        for tenth, outcome in failures:
            x = tenth / 10.0
            place = next((index for index, other in enumerate(founded) if abs(other - x) <= tenths / 10.0), None)
            if place is None:
                place = len(founded)
                founded.append(x)
            answer = made.fail(x, outcome)
            history.append((place, MISSED if outcome == MISSED else BLOCKED, session.clock.now()))
            for kind in (BLOCKED, MISSED):
                times = [time for *where, time in history if where == [place, kind]]
                if 0 < limit <= len(times) and times[-1] - times[0] >= wait - 1e-6:
                    stuck.add((place, kind))
            assert answer == any((place, kind) in stuck for kind in (BLOCKED, MISSED))
        assert len(session.recorded(EventKind.STUCK)) == len(stuck)


# ------------------------------------------------------------------------------------------- places to avoid
@pytest.fixture
def avoiding(stand):
    """``avoiding(**parameters)``: a monitor, and ``closed``: what it closes on the map, call by call."""

    def make(**parameters):
        made = stand(**parameters)
        closed = []
        made.session.server.avoid = lambda places: closed.append([round(place.centre.x, 6) for place in places])
        made.monitor = StuckMonitor(made.session.server.runtime, made.session.server.plugins)
        return made, closed

    return make


def recovered_at(made, x):
    made.session.robot._x = x
    made.session.clock.sleep(0.05)
    made.monitor.note_recovery("back_up", 0)


def test_a_place_without_hold_is_closed_once_the_robot_has_left_it(avoiding):
    made, closed = avoiding(stuck_distance=0.5)
    made.fail(3.0, STUCK)
    recovered_at(made, 3.0)
    assert not closed
    recovered_at(made, 2.5)
    assert closed == [[3.25]]


def test_a_place_where_others_are_in_the_way_is_not_closed(avoiding):
    made, closed = avoiding()
    for _ in range(5):
        made.fail(3.0, BLOCKED)
        recovered_at(made, 2.0)
    assert not closed


def test_a_robot_that_gets_nowhere_again_and_again_avoids_the_place(avoiding):
    made, closed = avoiding()
    for _ in range(3):
        assert not closed
        made.fail(3.0, ExePathOutcome.OSCILLATION)
        recovered_at(made, 2.0)
    assert closed == [[3.25]]


def test_where_no_plan_is_left_all_places_are_open_for_the_rest_of_the_goal(avoiding):
    made, closed = avoiding()
    made.fail(3.0, STUCK)
    recovered_at(made, 2.0)
    made.fail(2.0, GetPathOutcome.NO_PATH_FOUND)
    made.fail(3.0, STUCK)
    recovered_at(made, 2.0)
    assert closed == [[3.25], []]


def test_a_robot_that_slides_onto_a_closed_place_may_plan_from_there(avoiding):
    made, closed = avoiding(stuck_distance=0.5)
    made.fail(3.0, STUCK)
    recovered_at(made, 2.0)
    made.fail(2.8, GetPathOutcome.BLOCKED_START)
    recovered_at(made, 2.0)
    assert closed == [[3.25], [], [3.25]]


def test_a_goal_that_is_over_leaves_no_place_closed(avoiding):
    made, closed = avoiding()
    made.fail(3.0, STUCK)
    recovered_at(made, 2.0)
    made.monitor.finish()
    assert closed == [[3.25], []]
    made.fail(6.0, STUCK)
    recovered_at(made, 5.0)
    assert closed[-1] == [6.25]


def test_the_third_longer_path_at_one_place_is_a_setback_too_many(stand):
    there = stand(stuck_distance=0.5)
    assert [there.replace_path(x, 7.0) for x in (0.0, 3.0, 0.1, 3.1, 0.2, 0.2, 3.2)] == [*[False] * 4, True, True, True]


def test_a_path_that_is_hardly_longer_is_no_setback(stand):
    there = stand()
    assert not any(there.replace_path(0.0, 5.9) for _ in range(5))


def test_setbacks_of_one_goal_do_not_count_for_the_next_one(stand):
    there = stand()
    assert [there.replace_path(0.0, 7.0) for _ in range(2)] == [False, False]
    there.monitor.restart()
    assert not there.replace_path(0.0, 7.0)


def test_where_stuck_robots_are_not_looked_for_setbacks_are_none_either(stand):
    there = stand(stuck_failures=0)
    assert not any(there.replace_path(0.0, 7.0) for _ in range(5))
