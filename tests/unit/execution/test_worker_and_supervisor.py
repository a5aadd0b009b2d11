"""The machinery under the actions: a slot's worker, the supervisor of plugin calls, and the callback thread."""

import pytest

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.execution.supervisor import Supervisor
from mbf_abstract.execution.worker import Worker
from mbf_abstract.goals.callbacks import CallbackThread
from mbf_abstract.time.clock import ThreadDetached
from mbf_abstract.time.sim_clock import SimClock


@pytest.fixture
def clock():
    return SimClock()


class TimedJob:
    """A job that takes ``seconds`` and ends at once when it is preempted, unless it is ``deaf``."""

    def __init__(self, clock, name, seconds, log, deaf=False):
        self.name, self.seconds, self.log, self.deaf = name, seconds, log, deaf
        self.clock = clock
        self.preempted = False

    def run(self):
        self.log.append(f"{self.name} starts at {self.clock.now():g}")
        end = self.clock.now() + self.seconds
        while self.clock.now() < end - 1e-9 and not (self.preempted and not self.deaf):
            self.clock.sleep(min(0.1, end - self.clock.now()))
        self.log.append(f"{self.name} ends at {round(self.clock.now(), 6):g}")

    def preempt(self):
        self.preempted = True


@pytest.fixture
def jobs(clock):
    log = []

    def make(name, seconds, **options):
        return TimedJob(clock, name, seconds, log, **options)

    make.log = log
    return make


def test_jobs_run_in_order_on_one_thread_that_is_reused(clock, jobs):
    worker = Worker(clock, "slot 0")
    for name in "abc":
        worker.submit(jobs(name, 0.1))
        clock.sleep(1.0)
        assert not worker.busy
    assert len(jobs.log) == 6
    names = clock.thread_names
    assert names.count("slot 0") == 1


def test_a_new_job_preempts_the_running_one_and_waits_for_its_end(clock, jobs):
    worker = Worker(clock, "slot 0")
    worker.submit(jobs("a", 10.0))
    clock.sleep(0.05)
    assert worker.submit(jobs("b", 1.0)) is None
    assert worker.busy
    clock.sleep(5.0)
    assert jobs.log == ["a starts at 0", "a ends at 0.1", "b starts at 0.1", "b ends at 1.1"]


def test_only_the_newest_job_waits(clock, jobs):
    worker = Worker(clock, "slot 0")
    worker.submit(jobs("a", 1.0, deaf=True))
    clock.sleep(0.05)
    second, third = jobs("b", 1.0), jobs("c", 1.0)
    assert worker.submit(second) is None
    assert worker.submit(third) is second
    clock.sleep(5.0)
    assert [line for line in jobs.log if "starts" in line] == ["a starts at 0", "c starts at 1"]


def test_an_abandoned_job_frees_the_slot_and_its_thread_ends_with_it(clock, jobs):
    worker = Worker(clock, "slot 0")
    hung = jobs("a", 10.0, deaf=True)
    worker.submit(hung)
    clock.sleep(0.5)
    worker.submit(jobs("b", 1.0))
    worker.abandon(hung)
    clock.sleep(2.0)
    assert jobs.log == ["a starts at 0", "b starts at 0.5", "b ends at 1.5"]
    clock.sleep(20.0)
    assert clock.thread_names.count("slot 0") == 1
    worker.abandon(hung)  # without effect: it is over
    worker.submit(jobs("c", 0.1))
    clock.sleep(1.0)
    assert jobs.log[-1].startswith("c ends")


def test_a_closed_worker_gives_its_waiting_job_back_and_takes_no_more(clock, jobs):
    worker = Worker(clock, "slot 0")
    worker.submit(jobs("a", 1.0, deaf=True))
    clock.sleep(0.1)
    waiting, late = jobs("b", 1.0), jobs("c", 1.0)
    worker.submit(waiting)
    assert worker.close() is waiting
    assert worker.submit(late) is late
    clock.sleep(5.0)
    assert jobs.log == ["a starts at 0", "a ends at 1"]
    assert "slot 0" not in set(clock.thread_names)


# --------------------------------------------------------------------------------------------- supervisor
def test_a_watch_is_asked_when_it_wants_to_be(clock):
    supervisor, asked = Supervisor(clock, EventBus(clock.now)), []

    def check():
        asked.append(round(clock.now(), 3))
        return 0.5 if len(asked) < 3 else None

    supervisor.watch(check, first_in=1.0)
    clock.sleep(10.0)
    assert asked == [1.0, 1.5, 2.0]


def test_a_poked_watch_is_asked_at_once_also_when_it_is_poked_during_its_check(clock):
    supervisor, asked = Supervisor(clock, EventBus(clock.now)), []

    def check():
        asked.append(round(clock.now(), 3))
        if len(asked) == 1:
            supervisor.poke(watch)
        return 100.0

    watch = supervisor.watch(check, first_in=100.0)
    clock.sleep(1.0)
    supervisor.poke(watch)
    clock.sleep(1.0)
    assert asked == [1.0, 1.0]


def test_a_stopped_watch_is_asked_no_more(clock):
    supervisor, asked = Supervisor(clock, EventBus(clock.now)), []
    watch = supervisor.watch(lambda: asked.append("stopped"), 0.5)
    supervisor.stop(watch)
    supervisor.stop(watch)
    supervisor.poke(watch)
    clock.sleep(1.0)
    assert asked == []


def test_a_closed_supervisor_still_asks_what_is_watched_and_then_its_thread_ends(clock):
    supervisor, asked = Supervisor(clock, EventBus(clock.now)), []
    supervisor.watch(lambda: asked.append("early"), 0.5)
    stopped = supervisor.watch(lambda: asked.append("stopped"), 2.0)
    supervisor.close()
    clock.sleep(1.0)
    assert "supervisor" in set(clock.thread_names)
    supervisor.stop(stopped)
    clock.sleep(0.0)
    assert "supervisor" not in set(clock.thread_names)
    supervisor.watch(lambda: asked.append("late"), 0.5)  # e.g. a done callback of a goal that has just ended
    clock.sleep(1.0)
    assert asked == ["early", "late"]
    assert "supervisor" not in set(clock.thread_names)


@pytest.mark.parametrize("error", [RuntimeError("no more threads"), SystemExit(1)])
def test_a_check_that_raises_is_reported_and_asked_again_and_the_others_are_served(clock, error):
    memory = MemorySink()
    supervisor, asked = Supervisor(clock, EventBus(clock.now, [memory])), []

    def raise_at_first():
        asked.append(round(clock.now(), 3))
        if len(asked) < 4:
            raise error

    supervisor.watch(raise_at_first, 1.0)
    supervisor.watch(lambda: asked.append("other"), 1.05)
    clock.sleep(5.0)
    assert asked == [1.0, "other", 1.1, 1.2]
    assert [event.data["type"] for event in memory.of_kind(EventKind.FAULT)] == [type(error).__name__] * 2


def test_a_nearer_watch_is_not_delayed_by_a_farther_one(clock):
    supervisor, asked = Supervisor(clock, EventBus(clock.now)), []
    supervisor.watch(lambda: asked.append(("far", clock.now())), 5.0)
    clock.sleep(1.0)
    supervisor.watch(lambda: asked.append(("near", clock.now())), 1.0)
    clock.sleep(9.0)
    assert asked == [("near", 2.0), ("far", 5.0)]


# ---------------------------------------------------------------------------------------------- callbacks
@pytest.fixture
def memory():
    return MemorySink()


@pytest.fixture
def make_callbacks(clock, memory):
    def make(**options):
        events = EventBus(clock.now, [memory])
        return CallbackThread(clock, events, Supervisor(clock, events), **options)

    return make


def test_callbacks_run_in_order_and_not_on_the_callers_thread(clock, make_callbacks):
    callbacks, log = make_callbacks(), []
    for i in range(3):
        callbacks.submit(lambda i=i: log.append(i))
    assert log == []
    clock.sleep(0.0)
    assert log == [0, 1, 2]


def test_a_callback_that_raises_harms_nobody(clock, make_callbacks, memory):
    callbacks, log = make_callbacks(), []

    def bad():
        raise ValueError("my fault")

    callbacks.submit(bad)
    callbacks.submit(lambda: log.append("next"))
    clock.sleep(0.1)
    assert log == ["next"]
    assert memory.of_kind(EventKind.FAULT)[0].data["message"] == "a user callback raised: my fault"


def test_a_callback_that_blocks_is_left_alone_and_the_others_are_served(clock, make_callbacks, memory):
    callbacks, log = make_callbacks(patience=5.0), []
    callbacks.submit(lambda: clock.sleep(1e6))
    callbacks.submit(lambda: log.append(clock.now()))
    clock.sleep(20.0)
    assert log == [5.0]
    assert "blocked for over 5.0 s" in memory.of_kind(EventKind.FAULT)[0].data["message"]


def test_with_too_many_blocked_callbacks_the_others_wait_until_one_comes_back(clock, make_callbacks):
    callbacks, log = make_callbacks(patience=1.0, max_blocked=2), []
    for seconds in (10.0, 1e6, 1e6):
        callbacks.submit(lambda seconds=seconds: clock.sleep(seconds))
    for i in range(2000):
        callbacks.submit(lambda i=i: log.append((i, clock.now())))
    clock.sleep(9.0)
    assert log == []
    assert clock.thread_names.count("callbacks") == 3
    clock.sleep(2.0)
    assert log == [(i, 10.0) for i in range(2000)]
    assert clock.thread_names.count("callbacks") == 3


def test_of_what_one_taker_has_not_taken_only_the_newest_stays_and_keeps_its_place(clock, make_callbacks):
    callbacks, log = make_callbacks(), []
    callbacks.submit(lambda: clock.sleep(1.0))
    for i in range(1000):
        callbacks.submit(lambda i=i: log.append(i), newest_of="feedback")
        if i == 0:
            callbacks.submit(lambda: log.append("done"))
    clock.sleep(2.0)
    assert log == [999, "done"]


def test_a_blocked_taker_gets_nothing_until_it_returns(clock, make_callbacks):
    callbacks, log = make_callbacks(patience=1.0, max_blocked=1), []
    callbacks.submit(lambda: clock.sleep(5.0), newest_of="slow")
    for i in range(6):
        clock.sleep(1.0)
        callbacks.submit(lambda i=i: log.append((i, "slow")), newest_of="slow")
        callbacks.submit(lambda i=i: log.append((i, "quick")), newest_of="quick")
    clock.sleep(1.0)
    assert [i for i, who in log if who == "quick"] == [0, 1, 2, 3, 4, 5]
    assert [i for i, who in log if who == "slow"] == [4, 5]


@pytest.mark.parametrize("error", [SystemExit(1), KeyboardInterrupt(), GeneratorExit(), ThreadDetached("liar")])
def test_a_callback_that_raises_what_nobody_expects_delays_nobody(clock, make_callbacks, error):
    def bad():
        raise error

    callbacks, log = make_callbacks(), []
    for i in range(10):
        callbacks.submit(bad)
        callbacks.submit(lambda i=i: log.append((i, clock.now())))
    clock.sleep(0.1)
    assert log == [(i, 0.0) for i in range(10)]


def test_closing_runs_what_is_queued_and_what_comes_later(clock, make_callbacks):
    callbacks, log = make_callbacks(), []
    callbacks.submit(lambda: log.append("queued"))
    callbacks.close()
    clock.sleep(0.1)
    assert "callbacks" not in set(clock.thread_names)
    callbacks.submit(lambda: log.append("later"))
    clock.sleep(0.1)
    assert log == ["queued", "later"]
    assert "callbacks" not in set(clock.thread_names)
