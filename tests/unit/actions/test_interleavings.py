"""Seeded schedules of start, cancel, preempt, pause, finish and shut-down, on a clock that shuffles its threads.

Each schedule is one seed: it draws plugins that take any time, fail, raise or hang, and a script of client actions
at any moment. Whatever the order, every goal reaches exactly one final state and the robot stands at the end. A seed
that fails here fails again: run it with ``MBF_SCHEDULES=20 MBF_FIRST_SCHEDULE=<seed>``. CI sets 10000.
"""

import gc
import os

import numpy as np
import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.goals.goal_types import ExePathGoal, FollowWaypointsGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import drive, obedient, slow
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery, straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.sim_clock import SimClock

pytestmark = pytest.mark.usefixtures("one_core")

SCHEDULES = int(os.environ.get("MBF_SCHEDULES", "2000"))
FIRST = int(os.environ.get("MBF_FIRST_SCHEDULE", "0"))
PARTS = 20
PLUGINS = {
    "planner": ScriptedPlanner,
    "controller": ScriptedController,
    "other": ScriptedController,
    "recovery": ScriptedRecovery,
}
NEAR = Path.from_points([(0.0, 0.0, 0.0), (0.2, 0.0, 0.0)])
FAR = Path.from_points([(0.0, 0.0, 0.0), (50.0, 0.0, 0.0)])


def one_of(rng, options):
    """The option that ``rng.choice`` would draw, at a tenth of its cost."""
    return options[int(rng.integers(len(options)))]


def drawn(rng, bounds):
    """An index, drawn with the probabilities whose sums are ``bounds``, as by ``rng.choice``."""
    return int(bounds.searchsorted(rng.random(), side="right"))


def sums(*probabilities):
    added = np.cumsum(probabilities)
    return added / added[-1]


PLANNER_ANSWERS = sums(0.4, 0.1, 0.2, 0.2, 0.05, 0.05)
CONTROLLER_ANSWERS = sums(0.5, 0.15, 0.1, 0.1, 0.05, 0.05, 0.05)
RECOVERY_ANSWERS = sums(0.5, 0.2, 0.2, 0.1)
GOALS = sums(0.15, 0.3, 0.1, 0.35, 0.1)
ACTS = sums(0.45, 0.2, 0.2, 0.06, 0.06, 0.03)


def planner_answer(rng, clock):
    seconds = one_of(rng, (0.0, 0.03, 0.2))
    failure = PlanResult(GetPathOutcome.NO_PATH_FOUND, "no")
    return [
        straight_plan,
        failure,
        slow(clock, seconds, straight_plan),
        obedient(clock, seconds, straight_plan, PlanResult(GetPathOutcome.CANCELED, "as ordered")),
        RuntimeError("planner"),
        slow(clock, 1.5, failure),  # longer than patience and grace: quarantined for a while
    ][drawn(rng, PLANNER_ANSWERS)]


def controller_answer(rng, clock, controller):
    failure = ControlResult(ExePathOutcome.BLOCKED_PATH, "no")
    return [
        controller.follow,
        drive(0.3),
        failure,
        slow(clock, one_of(rng, (0.02, 0.2)), drive(0.2)),
        RuntimeError("controller"),
        ControlResult(ExePathOutcome.CANCELED, "enough"),
        slow(clock, 1.5, drive(2.0)),
    ][drawn(rng, CONTROLLER_ANSWERS)]


def recovery_answer(rng, clock):
    def drives(request):
        request.motion.send(Twist.planar(0.2))
        ended = not request.motion.sleep(0.15)
        return RecoveryResult(RecoveryOutcome.CANCELED if ended else 0, "")

    return [drives, RecoveryResult(0, ""), RecoveryResult(RecoveryOutcome.FAILURE, ""), RuntimeError("recovery")][
        drawn(rng, RECOVERY_ANSWERS)
    ]


def prepare(session, rng):
    session.planner.play(*[planner_answer(rng, session.clock) for _ in range(4)])
    for name in ("controller", "other"):
        controller = session.plugin(name, ScriptedController)
        controller.stops_itself = bool(rng.random() < 0.3)
        controller.play(*[controller_answer(rng, session.clock, controller) for _ in range(4)])
    session.recovery.play(*[recovery_answer(rng, session.clock) for _ in range(3)])


def random_goal(rng):
    controller = one_of(rng, ("", "controller", "other"))
    slot = int(rng.integers(2))
    return [
        GetPathGoal(Pose.planar(2.0, 0.0), concurrency_slot=slot),
        ExePathGoal(NEAR if rng.random() < 0.5 else FAR, controller=controller),
        RecoveryGoal(concurrency_slot=slot),
        MoveBaseGoal(Pose.planar(one_of(rng, (0.2, 50.0)), 0.0), controller=controller),
        FollowWaypointsGoal((Pose.planar(0.2, 0.0), Pose.planar(0.0, 0.0)), stop_on_failure=bool(rng.random() < 0.5)),
    ][drawn(rng, GOALS)]


def client(session, rng, handles, steps):
    """One client: sends, cancels, pauses and resumes at random moments."""
    for _ in range(steps):
        session.clock.sleep(one_of(rng, (0.0, 0.0, 0.01, 0.05, 0.1, 0.3)))
        act = rng.random()
        if act < 0.45 or not handles:
            handles.append(session.navigator.send(random_goal(rng)))
            handles[-1].add_done_callback(lambda handle: session.called.append(handle.id))
        else:
            handle, server = handles[int(rng.integers(len(handles)))], session.server
            acts = [handle.cancel, handle.pause, handle.resume, server.pause_all, server.resume_all, server.cancel_all]
            acts[drawn(rng, ACTS)]()


def run_schedule(seed):
    rng = np.random.default_rng(seed)
    clock = SimClock(schedule=np.random.default_rng(seed + 1_000_000_007))
    session = ScriptedSession(
        PLUGINS,
        clock,
        planner_patience=0.5,
        controller_patience=0.5,
        recovery_patience=0.5,
        cancel_grace=0.3,
        oscillation_timeout=one_of(rng, (0.0, 0.6)),
        planner_frequency=one_of(rng, (0.0, 5.0)),
        replan_failed_policy=one_of(rng, ("keep", "stop", "recover")),
        max_quarantined=100,
        controller_frequency=10.0,
    )
    session.robot._period = 0.2
    session.called = []
    prepare(session, rng)
    handles, helper_rng = [], np.random.default_rng(seed + 1)
    second = clock.spawn(lambda: client(session, helper_rng, handles, 3), "second client")
    client(session, rng, handles, 4)
    second.join()
    if rng.random() < 0.7:  # else shut down in the middle of everything
        for handle in list(handles):
            handle.resume()
            handle.cancel()
        clock.sleep(0.9)
    session.server.close()
    session.robot.close()
    clock.sleep(2.5)
    return session, handles


def verify(seed, session, handles):
    ends = [event.data["goal_id"] for event in session.recorded(EventKind.GOAL_FINISHED)]
    assert len(ends) == len(set(ends)), f"schedule {seed}: a goal ended twice"
    accepted = {event.data["goal_id"] for event in session.recorded(EventKind.GOAL_ACCEPTED)}
    assert accepted <= set(ends), f"schedule {seed}: goals without an end: {accepted - set(ends)}"
    assert all(handle.done and handle.result.message for handle in handles), f"schedule {seed}: {handles}"
    assert sorted(session.called) == sorted(handle.id for handle in handles), (
        f"schedule {seed}: callbacks {session.called}"
    )
    assert session.robot.command.is_stopped(), f"schedule {seed}: the robot still drives"
    waiting = set(session.clock.thread_names) - {"main"}
    assert not waiting, f"schedule {seed}: threads left: {waiting}"
    framework = [event for event in session.recorded(EventKind.FAULT) if "where" not in event.data]
    assert not framework, f"schedule {seed}: {framework[0].data}"


@pytest.mark.parametrize("part", range(PARTS))
@pytest.mark.timeout(600)
def test_every_goal_ends_once_and_the_robot_stands_whatever_the_order(part):
    for seed in range(FIRST + part * SCHEDULES // PARTS, FIRST + (part + 1) * SCHEDULES // PARTS):
        session, handles = run_schedule(seed)
        verify(seed, session, handles)
    gc.collect()
