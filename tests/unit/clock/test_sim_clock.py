"""SimClock: lockstep order, repeatability, deadlocks, foreign threads, and the guard against hung threads."""

import asyncio
import threading

import numpy as np
import pytest

from mbf_abstract.time.clock import Priority, ThreadDetached
from mbf_abstract.time.sim_clock import ClockDeadlock, SimClock


def test_time_jumps_to_the_earliest_wake_up():
    clock = SimClock()
    clock.sleep(1000.0)
    assert clock.now() == 1000.0


@pytest.mark.parametrize("error", [KeyboardInterrupt(), RuntimeError("can't start new thread")])
def test_time_goes_on_after_a_thread_that_could_not_be_started(monkeypatch, error):
    def fail(thread):
        raise error

    clock = SimClock()
    with monkeypatch.context() as patch, pytest.raises(type(error)):
        patch.setattr(threading.Thread, "start", fail)
        clock.spawn(lambda: None, "worker")
    assert clock.thread_names == ["main"]
    clock.sleep(1.0)
    assert clock.now() == 1.0


def test_time_stands_still_while_somebody_runs():
    clock = SimClock()
    before = clock.now()
    sum(range(100_000))
    assert clock.now() == before


def test_threads_wake_in_the_order_of_time_then_priority_then_arrival():
    clock, order = SimClock(), []

    def sleeper(name, stamp):
        def run():
            clock.sleep_until(stamp)
            order.append((name, clock.now()))

        return run

    clock.spawn(sleeper("late", 2.0), "late", Priority.SIMULATOR)
    clock.spawn(sleeper("client", 1.0), "client", Priority.CLIENT)
    clock.spawn(sleeper("worker b", 1.0), "worker b", Priority.WORKER)
    clock.spawn(sleeper("worker c", 1.0), "worker c", Priority.WORKER)
    clock.spawn(sleeper("simulator", 1.0), "simulator", Priority.SIMULATOR)
    clock.sleep(3.0)
    assert order == [("simulator", 1.0), ("worker b", 1.0), ("worker c", 1.0), ("client", 1.0), ("late", 2.0)]


def test_only_one_thread_runs_at_a_time():
    clock, inside, most = SimClock(), [0], [0]

    def worker():
        for _ in range(50):
            inside[0] += 1
            most[0] = max(most[0], inside[0])
            inside[0] -= 1
            clock.sleep(0.01)

    for i in range(5):
        clock.spawn(worker, f"worker {i}")
    clock.sleep(1.0)
    assert most == [1]


def _race(schedule=None):
    clock, log = SimClock(schedule=schedule), []
    condition = clock.condition()

    def worker(name):
        def run():
            for step in range(20):
                with condition:
                    log.append((round(clock.now(), 9), name, step))
                    condition.notify_all()
                    condition.wait(0.003 * (len(name) + step % 3))

        return run

    for name in ("a", "bb", "ccc"):
        clock.spawn(worker(name), name)
    clock.sleep(10.0)
    return log


def test_the_same_program_runs_the_same_way_twice():
    assert _race() == _race()


def test_a_seeded_schedule_repeats_and_another_seed_gives_another_order():
    runs = [_race(np.random.default_rng(seed)) for seed in (1, 1, 2)]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]
    assert sorted(name for _, name, _ in runs[2]) == sorted(["a", "bb", "ccc"] * 20)


def test_a_wait_ends_at_its_timeout_and_says_so():
    clock = SimClock()
    condition = clock.condition()
    with condition:
        assert condition.wait(0.25) is False
    assert clock.now() == 0.25


def test_a_notified_wait_ends_at_once_and_says_so():
    clock = SimClock()
    condition = clock.condition()

    def notifier():
        clock.sleep(0.1)
        with condition:
            condition.notify_all()

    clock.spawn(notifier, "notifier")
    with condition:
        assert condition.wait(5.0) is True
    assert clock.now() == pytest.approx(0.1)
    clock.sleep(10.0)  # the timer of the ended wait must not wake anybody


def test_a_wait_that_nobody_can_end_raises_instead_of_hanging_for_ever():
    clock = SimClock()
    condition = clock.condition()

    def waits_too():
        with condition:
            condition.wait()

    clock.spawn(waits_too, "the other one")
    with condition, pytest.raises(ClockDeadlock, match="the other one"):
        condition.wait()


def test_waiting_with_a_second_lock_held_is_refused():
    clock = SimClock()
    first, second = clock.condition(), clock.condition()
    with first, second, pytest.raises(RuntimeError, match="waits while it holds 1"):
        second.wait(1.0)
    with first, pytest.raises(RuntimeError, match="waits while it holds 1"):
        clock.sleep(1.0)


def test_join_waits_for_the_end_of_a_thread():
    clock = SimClock()
    thread = clock.spawn(lambda: clock.sleep(0.5), "short")
    assert thread.name == "short"
    assert not thread.join(0.2)
    assert thread.is_alive()
    assert thread.join()
    assert not thread.is_alive()
    assert clock.now() == 0.5


def test_a_foreign_thread_can_wait_and_wake_others():
    clock = SimClock(external=True)
    condition, reported = clock.condition(), []

    def outsider():
        with condition:
            reported.append(condition.wait(0.5))
            reported.append("done")
            condition.notify_all()

    thread = threading.Thread(target=outsider)
    thread.start()
    with condition:
        while len(reported) < 2:
            condition.wait()
    thread.join()
    assert reported == [False, "done"]


def test_outside_lets_the_others_run_and_comes_back_in_turn():
    clock, log = SimClock(), []
    left = threading.Event()

    def worker():
        clock.sleep(1.0)
        log.append("worker")
        left.set()

    clock.spawn(worker, "worker")
    with clock.outside():
        left.wait()
    log.append("main")
    assert log == ["worker", "main"]
    clock.sleep(1.0)


def test_several_coroutines_of_one_thread_can_be_outside_at_once():
    clock = SimClock()

    async def wait_outside(seconds):
        done = asyncio.get_running_loop().create_future()
        loop = asyncio.get_running_loop()

        def finish():
            clock.sleep(seconds)
            loop.call_soon_threadsafe(done.set_result, seconds)

        clock.spawn(finish, f"timer {seconds}")
        with clock.outside():
            return await done

    async def main():
        return await asyncio.gather(wait_outside(0.3), wait_outside(0.1), wait_outside(0.2))

    assert asyncio.run(main()) == [0.3, 0.1, 0.2]
    before = clock.now()
    clock.sleep(1.0)
    assert clock.now() == before + 1.0


@pytest.fixture
def hung():
    """A thread that keeps the processor busy in a guarded section until ``release`` is set."""

    class Hung:
        def __init__(self):
            self.clock = SimClock(hang_guard=0.05)
            self.release, self.ended = threading.Event(), threading.Event()
            self.caught = []
            self.labels = []

        def run(self):
            try:
                with self.clock.guarded("slow.make_plan", lambda: self.labels.append("slow.make_plan")):
                    self.release.wait()
                self.caught.append("nothing")
            except ThreadDetached as detached:
                self.caught.append(str(detached))
                raise
            finally:
                self.ended.set()

    return Hung()


def test_a_hung_section_is_detached_and_time_goes_on_without_it(hung):
    thread = hung.clock.spawn(hung.run, "hung")
    hung.clock.sleep(1.0)
    assert hung.clock.now() == 1.0
    assert hung.labels == ["slow.make_plan"]
    assert thread.is_alive()
    hung.release.set()
    hung.ended.wait()


def test_the_detached_thread_gets_an_exception_that_no_plugin_swallows(hung):
    hung.clock.spawn(hung.run, "hung")
    hung.clock.sleep(1.0)
    hung.release.set()
    hung.ended.wait()
    assert hung.caught == ["slow.make_plan"]
    assert issubclass(ThreadDetached, BaseException) and not issubclass(ThreadDetached, Exception)


def test_the_first_call_into_the_clock_ends_a_detached_thread():
    clock = SimClock(hang_guard=0.05)
    release, reached, log = threading.Event(), threading.Event(), []

    def stubborn():
        with clock.guarded("stubborn"):
            release.wait()
            try:
                clock.sleep(1.0)
                log.append("slept")
            except Exception:
                log.append("swallowed")
            finally:
                reached.set()

    clock.spawn(stubborn, "stubborn")
    clock.sleep(1.0)
    release.set()
    reached.wait()
    assert log == []


def test_a_guarded_section_that_waits_now_and_then_is_not_hung():
    clock = SimClock(hang_guard=0.2)
    busy = threading.Event()

    def patient():
        with clock.guarded("patient"):
            for _ in range(10):
                busy.wait(0.03)
                clock.sleep(0.1)

    thread = clock.spawn(patient, "patient")
    assert thread.join(5.0)
    assert clock.now() == pytest.approx(1.0)


def test_the_guards_own_thread_ends_with_the_last_thread_it_guards():
    clock, others = SimClock(hang_guard=10.0), set(threading.enumerate())

    def guarded():
        with clock.guarded("short"):
            clock.sleep(0.1)

    for _ in range(2):
        thread = clock.spawn(guarded, "guarded")
        guards = [one for one in set(threading.enumerate()) - others if one.name == "hang guard"]
        thread.join()
        for guard in guards:
            guard.join(5.0)
            assert not guard.is_alive()


def test_a_wait_that_is_too_short_for_the_clocks_numbers_still_ends():
    clock = SimClock()
    clock.sleep(1000.0)
    deadline = clock.now() + 1e-18 + 2e-13
    condition = clock.condition()
    with condition:
        while (remaining := deadline - clock.now()) > 0.0:
            condition.wait(remaining / 2.0)
    assert clock.now() >= deadline
