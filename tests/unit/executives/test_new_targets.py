"""A new target or a cancel in every branch of the navigation tree: the robot goes there, or stands; no goal is left."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from mbf_abstract.events import EventKind
from mbf_abstract.executives.conditions import Do
from mbf_abstract.executives.leaves import MoveBase
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.time.clock import Priority
from mbf_abstract.time.sim_clock import SimClock

GOAL, OTHER = Pose.planar(3.0, 0.0), Pose.planar(1.0, 1.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
COLLISION = ControlResult(ExePathOutcome.COLLISION, "a wall")
BRANCHES = ["get path", "recover: clear", "follow path", "update path", "recover: back_up", "escalate"]


def back_off(request):
    """A recovery that drives backwards for a second."""
    for _ in range(10):
        if not (request.motion.send(drive(-0.1).command) and request.motion.sleep(0.1)):
            return RecoveryResult(RecoveryOutcome.CANCELED, "canceled")
    return RecoveryResult(RecoveryOutcome.SUCCESS, "backed off")


@pytest.fixture
def eventful(make_session):
    """A session in which every branch has its turn: plans take time and fail, driving fails, the robot is stuck."""

    def make(**options):
        session = make_session(stuck_time=0.0, escalation_behaviors=("relax",), stuck_distance=1.0, **options)
        session.planner.modelled_compute_time = 0.2
        session.planner.play(NO_PATH, straight_plan)
        for name in ("clear", "back_up", "relax"):
            session.plugin(name, object).play(back_off)
        bumps = [drive(0.3)] * 20 + [COLLISION]
        session.controller.play(*bumps * 3, session.controller.follow)
        return session

    return make


def tree():
    return navigation_tree(
        TreeOptions(check_poses=False, second_planner_pause=0.3, second_planner_look_ahead=0.0, progress_timeout=5.0)
    )


def assert_at_rest(session):
    assert session.robot.command.is_stopped()
    accepted, finished = (
        {event.data["goal_id"] for event in session.recorded(kind)}
        for kind in (EventKind.GOAL_ACCEPTED, EventKind.GOAL_FINISHED)
    )
    assert accepted == finished
    now = session.clock.now()
    session.clock.sleep(2.0)
    assert session.robot.moved_after(now) == []


def assert_reached(session, result, target):
    assert result.success, result.message
    assert result.mission.target == target
    assert session.robot.pose.distance_to(target) < 0.15
    assert_at_rest(session)


def when_running(executive, name, act):
    """Act once, at the first tick after which the node of this name runs; a list that then holds the tick."""
    ticks = []
    node = next(node for node in executive.tree.iterate() if node.name == name)

    def look(tick):
        if not ticks and node.status == Status.RUNNING:
            ticks.append(tick)
            act()

    executive.on_tick.append(look)
    return ticks


@pytest.mark.parametrize("branch", BRANCHES)
def test_a_new_target_in_every_branch_is_reached(eventful, branch):
    session = eventful()
    executive = TreeExecutive(tree(), session.navigator)
    ticks = when_running(executive, branch, lambda: executive.change_target(OTHER))
    result = executive.run(GOAL)
    assert ticks, "the branch had its turn"
    assert_reached(session, result, OTHER)
    sent = [e for e in session.recorded(EventKind.GOAL_ACCEPTED) if e.source == "get_path"]
    assert sent[-1].data["target"] == list(OTHER.position)


@pytest.mark.parametrize("branch", BRANCHES)
def test_a_cancel_in_every_branch_ends_the_run_at_once(eventful, branch):
    session = eventful()
    executive = TreeExecutive(tree(), session.navigator)
    times = []
    ticks = when_running(executive, branch, lambda: (times.append(session.clock.now()), executive.cancel("enough")))
    result = executive.run(GOAL)
    assert ticks, "the branch had its turn"
    assert (result.status, result.message) == (Status.INVALID, "enough")
    assert session.clock.now() - times[0] < 0.3
    assert_at_rest(session)


@given(tick=st.integers(1, 160))
@settings(max_examples=16, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_new_target_at_any_tick_is_reached(eventful, tick):
    session = eventful()
    executive = TreeExecutive(tree(), session.navigator)
    taken = []
    executive.on_tick.append(lambda count: taken.append(executive.change_target(OTHER)) if count == tick else None)
    result = executive.run(GOAL)
    assert_reached(session, result, OTHER if taken else GOAL)


@pytest.mark.parametrize("seed", range(6))
def test_a_new_target_holds_for_any_interleaving_of_the_threads(eventful, seed):
    rng = np.random.default_rng(seed)
    session = eventful(clock=SimClock(schedule=rng))
    executive = TreeExecutive(tree(), session.navigator)
    seconds, taken = float(rng.uniform(0.0, 8.0)), []

    def change_later():
        session.clock.sleep(seconds)
        taken.append(executive.change_target(OTHER))

    session.clock.spawn(change_later, "client", Priority.CLIENT)
    result = executive.run(GOAL)
    assert_reached(session, result, OTHER if taken == [True] else GOAL)


def test_a_target_that_comes_with_the_last_tick_is_not_lost(make_session):
    session = make_session()
    executive = TreeExecutive(Do("done", lambda mission: True), session.navigator)
    executive.on_tick.append(lambda tick: executive.change_target(OTHER) if tick == 1 else None)
    result = executive.run(GOAL)
    assert result.success and result.mission.target == OTHER


def test_of_two_targets_between_two_ticks_the_last_one_counts(make_session):
    session = make_session()
    executive = TreeExecutive(MoveBase(), session.navigator)
    executive.on_tick.append(
        lambda tick: (executive.change_target(GOAL), executive.change_target(OTHER)) if tick == 3 else None
    )
    assert_reached(session, executive.run(GOAL), OTHER)


def test_without_a_run_a_new_target_is_refused(make_session):
    session = make_session()
    executive = TreeExecutive(tree(), session.navigator)
    assert not executive.change_target(OTHER)
    assert executive.run(GOAL).success
    assert not executive.change_target(OTHER)


def test_a_canceled_run_takes_no_new_target(make_session):
    session = make_session()
    executive = TreeExecutive(tree(), session.navigator)
    answers = []
    executive.on_tick.append(lambda tick: (executive.cancel("stop"), answers.append(executive.change_target(OTHER))))
    assert executive.run(GOAL).status == Status.INVALID
    assert answers == [False]


def test_failures_on_the_way_to_the_old_target_are_forgotten(make_session, recoveries):
    session = make_session(stuck_time=0.0, escalation_behaviors=("relax",))
    session.planner.play(NO_PATH, NO_PATH, NO_PATH, NO_PATH, straight_plan)
    executive = TreeExecutive(navigation_tree(TreeOptions(check_poses=False)), session.navigator)
    ticks = when_running(executive, "escalate", lambda: executive.change_target(OTHER))
    assert_reached(session, executive.run(GOAL), OTHER)
    assert ticks
    assert recoveries(session).count("clear") == 2, "one for each target"
    assert not session.recorded(EventKind.STUCK)
