"""When children are ticked: pipeline (F197 to F200), pacing, conditions (F201 to F205), decorators (F209 to F214)."""

import pytest
from py_trees.behaviours import TickCounter
from py_trees.common import OneShotPolicy, Status
from py_trees.composites import Sequence
from py_trees.decorators import OneShot, Repeat, Retry

from mbf_abstract.executives.conditions import GoalReached, TimePassed, truncated
from mbf_abstract.executives.mission import MissionContext
from mbf_abstract.executives.pacing import (
    BySpeed,
    Delay,
    EveryDistance,
    EverySeconds,
    InBackground,
    PipelineSequence,
    TimeLimit,
)
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.result_types import ActionResult
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.faulty import drive


@pytest.fixture
def session(make_session):
    return make_session()


@pytest.fixture
def bind(session):
    """Let a tree run on the session."""

    def run(tree, target=None):
        for node in tree.iterate():
            node.setup(mission=MissionContext(session.navigator, target))
        return tree

    return run


@pytest.fixture
def tick_every(session, tick):
    """Tick, then wait ``seconds``, ``times`` times; returns the statuses."""

    def run(tree, seconds, times):
        seen = ""
        for _ in range(times):
            seen += tick(tree)
            session.clock.sleep(seconds)
        return seen

    return run


# ---------------------------------------------------------------------------------------------------- pipeline
def test_f197_earlier_children_are_ticked_again_while_a_later_one_runs(scripted, tick):
    children = [scripted("SRSR"), scripted("RRS"), scripted("R")]
    assert tick(PipelineSequence("pipe", children), 4) == "RRRR"
    assert [child.ticks for child in children] == [4, 4, 2]


def test_f198_the_last_child_decides_even_while_the_first_runs(scripted, tick):
    assert tick(PipelineSequence("pipe", [scripted("SR"), scripted("S"), scripted("RS")]), 2) == "RS"


def test_f199_a_failure_before_a_running_child_ends_all(scripted, tick):
    tree = PipelineSequence("pipe", [scripted("SF"), scripted("S"), scripted("R")])
    assert tick(tree, 2) == "RF"
    assert [child.status for child in tree.children] == [Status.INVALID] * 3


def test_f200_one_failure_fails_the_pipeline(scripted, tick):
    assert tick(PipelineSequence("pipe", [scripted("S"), scripted("F")])) == "F"


# ------------------------------------------------------------------------------------------------------ pacing
def test_f201_distance_paces_the_child(session, bind, scripted, tick):
    child = scripted("S")
    tree = bind(EveryDistance("every metre", child, 1.0))
    counts = []
    for step in range(7):
        session.robot._x = 0.51 * step
        session.clock.sleep(0.05)
        tick(tree)
        counts.append(child.ticks)
    assert counts == [1, 1, 2, 2, 3, 3, 4]


def test_exactly_the_distance_is_far_enough(session, bind, scripted, tick):
    child = scripted("S")
    tree = bind(EveryDistance("every metre", child, 1.0))
    for session.robot._x in (0.0, 1.0):
        session.clock.sleep(0.05)
        tick(tree)
    assert child.ticks == 2


def test_after_having_been_idle_a_paced_child_starts_at_once(bind, scripted, tick):
    child = scripted("S")
    tree = bind(EverySeconds("every minute", child, 60.0))
    tick(tree, 2)
    assert child.ticks == 1
    tree.stop(Status.INVALID)
    tick(tree, 2)
    assert child.ticks == 2


def test_f202_speed_paces_the_child(session, bind, scripted, tick):
    tree = bind(BySpeed("by speed", scripted("S"), 0.1, 1.0, 0.5))
    tick(tree)
    assert tree.period == 1.0
    session.robot.send_command(drive(0.223).command)
    session.clock.sleep(1.0)
    tick(tree)
    assert tree.period == pytest.approx(2.0, abs=0.01)
    session.robot.send_command(drive(0.0).command)
    session.clock.sleep(2.05)
    tick(tree)
    assert tree.period == pytest.approx(10.0)
    assert tree.decorated.ticks == 3


def test_a_rate_waits_for_a_child_that_takes_longer(bind, scripted, tick_every):
    child = scripted("RRRS")
    tree = bind(EverySeconds("every second", child, 1.0))
    assert tick_every(tree, 0.5, 6) == "RRRSSR"
    assert child.entries == 2


def test_f203_time_passes_again_and_again(bind, tick_every):
    tree = bind(TimePassed("one second", 1.0))
    assert tick_every(tree, 0.5, 7) == "FFSFSFS"


def test_f204_the_goal_is_reached_within_its_distance(session, bind, tick):
    tree = bind(GoalReached(distance=0.25), Pose.planar(1.0, 1.0))
    seen = ""
    for place in (0.0, 0.5, 0.9, 1.0):
        session.robot._x = session.robot._y = place
        session.clock.sleep(0.05)
        seen += tick(tree)
    assert seen == "FFSS"


def test_f205_a_path_is_cut_off_before_its_end():
    path = Path.from_points([(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.9, 0.0, 0.0), (1.5, 0.5, 0.0)])
    cut = truncated(path, 1.0)
    assert len(cut) == 2
    assert cut[-1].yaw == pytest.approx(0.463, abs=1e-3)


# -------------------------------------------------------------------------------------------------- decorators
def test_f209_retry_counts_failures(scripted, tick):
    failing, succeeding = scripted("F"), scripted("S")
    assert tick(Retry("retry", failing, 3), 3)[-1] == "F"
    assert failing.ticks == 3
    assert tick(Retry("retry", succeeding, 3)) == "S"


def test_f210_repeat_counts_successes(scripted, tick):
    succeeding, failing = scripted("S"), scripted("F")
    assert tick(Repeat("repeat", succeeding, 3), 3)[-1] == "S"
    assert succeeding.ticks == 3
    assert tick(Repeat("repeat", failing, 3)) == "F"


@pytest.mark.parametrize(("script", "seen"), [("RRRRRS", "RRRRF"), ("RS", "RS")])
def test_f211_a_time_limit_halts_a_slow_child(bind, scripted, tick_every, script, seen):
    tree = bind(TimeLimit("100 ms", scripted(script), 0.1))
    assert tick_every(tree, 0.025, len(seen)) == seen
    assert (tree.decorated.status == Status.INVALID) is (seen[-1] == "F")


def test_f212_a_child_of_one_shot_runs_once(scripted, tick):
    once, always = scripted("S"), scripted("S")
    tree = Sequence("s", memory=False, children=[OneShot("once", once, OneShotPolicy.ON_COMPLETION), always])
    tick(tree, 5)
    assert (once.ticks, always.ticks) == (1, 5)


def test_f213_a_delay_holds_its_child_back(bind, scripted, tick_every):
    tree = bind(Delay("100 ms", scripted("S"), 0.1))
    assert tick_every(tree, 0.05, 3) == "RRS"


def test_f214_a_time_limit_around_a_thousand_retries_never_hangs(bind, scripted, tick_every):
    tree = bind(TimeLimit("9 ms", Retry("retry", scripted("F"), 1000), 0.009))
    assert set(tick_every(tree, 0.002, 1000)) == {"R", "F"}


def test_what_runs_in_the_background_never_ends(bind, scripted, tick):
    child = scripted("SFRS")
    assert tick(bind(InBackground("beside", child)), 4) == "RRRR"
    assert child.ticks == 4


def test_what_runs_in_the_background_ends_once_it_has_found_a_failure_of_the_mission(bind, scripted, tick):
    tree = bind(InBackground("beside", scripted("S")))
    assert tick(tree, 2) == "RR"
    tree.mission.failure = ActionResult(int(ExePathOutcome.BLOCKED_PATH), "it is of no use")
    assert tick(tree, 2) == "FR"


def test_py_trees_own_nodes_go_into_our_trees(bind, tick):
    tree = bind(Delay("at once", TickCounter("count", 1, Status.SUCCESS), 0.0))
    assert tick(tree, 2) == "RS"
