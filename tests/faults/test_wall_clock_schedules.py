"""Fault table, row 15 on real threads: random schedules with random delays at every lock, queue and thread start.

A few hundred goals with every run of the tests; ``pytest -m stress`` sends 20,000. Real threads do not repeat
themselves: what a seed repeats are the actions and the distribution of the delays.
"""

import random
import sys
import threading
import time
from collections import Counter

import numpy as np
import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.goals.goal_types import ExePathGoal, FollowWaypointsGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import drive, obedient, slow
from mbf_abstract.testing.scripted import ScriptedController, straight_plan
from mbf_abstract.testing.scripted_session import SCRIPTED, ScriptedSession
from mbf_abstract.time.clock import WallClock

GOALS_PER_SERVER = 40
CLIENTS = 4
NEAR = Path.from_points([(0.0, 0.0, 0.0), (0.05, 0.0, 0.0)])
FAR = Path.from_points([(0.0, 0.0, 0.0), (50.0, 0.0, 0.0)])


class Delays:
    """Sleeps now and then: mostly not at all, often for a switch of threads, sometimes for milliseconds."""

    def __init__(self, seed):
        self._random = random.Random(seed)
        self._often = self._random.choice([0.0, 0.02, 0.1, 0.3])

    def __call__(self):
        draw = self._random.random()
        if draw < self._often:
            time.sleep(self._random.choice([0.0, 0.0, 1e-4, 1e-3, 5e-3]))


class DelayingCondition(threading.Condition):
    """A condition with a delay before and after it is taken, and after it is given back."""

    def __init__(self, delay):
        super().__init__(threading.Lock())
        self._delay = delay

    def __enter__(self):
        self._delay()
        super().__enter__()
        self._delay()
        return self

    def __exit__(self, *exc):
        super().__exit__(*exc)
        self._delay()

    def wait(self, timeout=None):
        self._delay()
        return super().wait(timeout)


class DelayingClock(WallClock):
    """A wall clock whose conditions and threads are late."""

    def __init__(self, seed):
        super().__init__()
        self.delay = Delays(seed)

    def condition(self):
        return DelayingCondition(self.delay)

    def spawn(self, target, name, priority=0):
        def late():
            self.delay()
            target()

        return super().spawn(late, name, priority)


class DelayingSink:
    """A delay under the lock of the events."""

    def __init__(self, delay):
        self.write = lambda event: delay()

    def close(self):
        pass


class Ledger:
    """What the callbacks of all goals received, in order."""

    def __init__(self):
        self.handles = []
        self.added = []
        self.calls = []

    def add_done_callback(self, handle):
        self.added.append(handle.id)
        handle.add_done_callback(lambda done: self.calls.append((done.id, "done", done.done)))

    def take(self, handle):
        self.handles.append(handle)
        if isinstance(handle.goal, ExePathGoal):
            handle.add_feedback_callback(lambda reported: self.calls.append((handle.id, "feedback", True)))
        self.add_done_callback(handle)

    def done_calls(self):
        return Counter(goal for goal, what, _ in list(self.calls) if what == "done")

    def missing(self):
        return Counter(self.added) - self.done_calls()

    def late_feedback(self):
        over = set()
        for goal, what, _ in self.calls:
            if what == "feedback" and goal in over:
                yield goal
            if what == "done":
                over.add(goal)


def prepare(session, rng):
    clock = session.clock
    canceled, no = PlanResult(GetPathOutcome.CANCELED, ""), PlanResult(GetPathOutcome.NO_PATH_FOUND, "no")
    plans = [straight_plan, no, slow(clock, 0.01, straight_plan), obedient(clock, 0.02, straight_plan, canceled)]
    plans += [RuntimeError("planner"), SystemExit("planner"), slow(clock, 0.25, no)]  # the last one is abandoned
    session.planner.play(*[plans[rng.choice(7, p=[0.4, 0.1, 0.2, 0.2, 0.04, 0.03, 0.03])] for _ in range(50)])
    blocked, enough = ControlResult(ExePathOutcome.BLOCKED_PATH, "no"), ControlResult(ExePathOutcome.CANCELED, "")
    for name in ("controller", "other"):
        controller = session.plugin(name, ScriptedController)
        controller.stops_itself = bool(rng.random() < 0.3)
        answers = [controller.follow, drive(0.3), blocked, slow(clock, 0.02, drive(0.2)), enough]
        answers += [RuntimeError("controller"), slow(clock, 0.25, drive(0.2))]
        weights = [0.5, 0.25, 0.1, 0.08, 0.03, 0.02, 0.02]
        controller.play(*[answers[rng.choice(7, p=weights)] for _ in range(50)])

    def creep(request):
        request.motion.send(Twist.planar(0.1))
        return RecoveryResult(0 if request.motion.sleep(0.02) else RecoveryOutcome.CANCELED, "")

    session.recovery.play(creep, RecoveryResult(RecoveryOutcome.FAILURE, ""), RuntimeError("recovery"), creep)


def random_goal(rng):
    slot, controller = int(rng.integers(2)), str(rng.choice(["", "controller", "other"]))
    near = Pose.planar(0.05, 0.0)
    return [
        GetPathGoal(near, concurrency_slot=slot),
        ExePathGoal(NEAR if rng.random() < 0.5 else FAR, controller=controller),
        RecoveryGoal(concurrency_slot=slot),
        MoveBaseGoal(near if rng.random() < 0.5 else Pose.planar(50.0, 0.0), controller=controller),
        FollowWaypointsGoal((near, Pose.planar(0.0, 0.0)), stop_on_failure=bool(rng.integers(2))),
    ][rng.choice(5, p=[0.4, 0.25, 0.1, 0.15, 0.1])]


def client(session, ledger, rng, goals):
    """Send goals, and cancel, pause, resume and ask about those of all clients at random moments."""
    server = session.server
    while goals > 0:
        time.sleep(float(rng.choice([0.0, 0.0, 1e-3, 5e-3, 2e-2])))
        if rng.random() < 0.5 or not ledger.handles:
            ledger.take(session.navigator.send(random_goal(rng)))
            goals -= 1
            continue
        handle = ledger.handles[int(rng.integers(len(ledger.handles)))]
        acts = [handle.cancel, handle.pause, handle.resume, lambda: ledger.add_done_callback(handle)]  # noqa: B023
        acts += [server.cancel_all, server.pause_all, server.resume_all]
        acts[rng.choice(7, p=[0.3, 0.1, 0.3, 0.2, 0.02, 0.04, 0.04])]()


def run_schedule(seed):
    """Run one server with its clients and return what went wrong, empty if nothing did."""
    rng = np.random.default_rng(seed)
    clock = DelayingClock(seed)
    plugins = {**SCRIPTED, "other": ScriptedController}
    limits = dict.fromkeys(("planner_patience", "controller_patience", "recovery_patience"), 0.1)
    session = ScriptedSession(
        plugins, clock, cancel_grace=0.05, max_quarantined=100, controller_frequency=100.0, **limits
    )
    session.events.add_sink(DelayingSink(clock.delay))
    prepare(session, rng)
    ledger = Ledger()
    seeds = rng.integers(2**31, size=CLIENTS)
    clients = [
        threading.Thread(target=client, args=(session, ledger, np.random.default_rng(s), GOALS_PER_SERVER // CLIENTS))
        for s in seeds
    ]
    for thread in clients:
        thread.start()
    for thread in clients:
        thread.join()
    if rng.random() < 0.7:  # else it is closed in the middle of everything
        for handle in ledger.handles:
            handle.resume()
            handle.cancel()
    elif rng.random() < 0.5:
        ledger.handles[-1].resume()
    session.server.close()
    try:
        return verify(session, ledger)
    finally:
        session.robot.close()


def verify(session, ledger):
    handles = ledger.handles
    for handle in handles:
        handle.wait(30.0)
    until = time.monotonic() + 30.0  # parts of move_base may end a little later, and callbacks too
    while (ledger.missing() or any(a.busy for a in session.server.actions)) and time.monotonic() < until:
        time.sleep(0.01)
    ends = Counter(event.data["goal_id"] for event in session.recorded(EventKind.GOAL_FINISHED))
    accepted = {event.data["goal_id"] for event in session.recorded(EventKind.GOAL_ACCEPTED)}
    problems = {
        "ended twice": [goal for goal, count in ends.items() if count > 1],
        "never ended": [goal for goal in accepted if goal not in ends],
        "without an end": [handle for handle in handles if not (handle.done and handle.result.message)],
        "done callbacks missing": list(ledger.missing()),
        "done callbacks too many": list(ledger.done_calls() - Counter(ledger.added)),
        "called before the end": [goal for goal, _, over in ledger.calls if not over],
        "feedback after the end": list(ledger.late_feedback()),
        "driving": [] if session.robot.command.is_stopped() else [session.robot.command],
        "faults of the framework": [e.data for e in session.recorded(EventKind.FAULT) if "where" not in e.data],
    }
    return {name: found for name, found in problems.items() if found}


def run_schedules(goals, first_seed):
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        for seed in range(first_seed, first_seed + goals // GOALS_PER_SERVER):
            problems = run_schedule(seed)
            assert not problems, f"schedule {seed}: {problems}"
    finally:
        sys.setswitchinterval(before)


@pytest.mark.parametrize("part", range(2))
def test_on_real_threads_every_goal_ends_once_and_every_callback_comes(part):
    run_schedules(80, first_seed=part * 1000)


@pytest.mark.stress
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("part", range(10))
def test_20000_goals_on_real_threads_end_once_each_with_all_their_callbacks(part):
    run_schedules(2000, first_seed=100_000 + part * 1000)
