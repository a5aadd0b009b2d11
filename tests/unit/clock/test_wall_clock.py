"""WallClock and Stopwatch. Nothing here waits for longer than a few milliseconds, and nothing asserts a duration."""

import signal
import threading

import pytest

from mbf_abstract.time.clock import Stopwatch, WallClock, wall_seconds
from mbf_abstract.time.sim_clock import SimClock


def test_the_wall_clock_starts_near_zero_and_never_runs_backwards():
    clock = WallClock()
    stamps = [clock.now() for _ in range(100)]
    assert stamps == sorted(stamps)
    assert 0.0 <= stamps[0]


def test_sleeping_reaches_the_asked_stamp():
    clock = WallClock()
    clock.sleep_until(0.002)
    assert clock.now() >= 0.002
    clock.sleep(-1.0)
    clock.sleep_until(0.0)


def test_a_condition_hands_over_between_threads():
    clock = WallClock()
    condition, log = clock.condition(), []

    def worker():
        with condition:
            log.append("worker")
            condition.notify_all()

    with condition:
        thread = clock.spawn(worker, "worker")
        while not log:
            condition.wait()
    assert thread.join()
    assert not thread.is_alive()
    assert thread.name == "worker"


def test_a_wait_without_a_notification_times_out():
    condition = WallClock().condition()
    with condition:
        assert condition.wait(0.001) is False


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="signals of this system are not sent to threads")
@pytest.mark.parametrize("kind", [WallClock, SimClock])
def test_a_signal_that_does_not_end_the_wait_of_the_main_thread_is_handled_during_it_nevertheless(kind):
    clock, handled, ended = kind(), threading.Event(), []
    condition, before = clock.condition(), signal.signal(signal.SIGINT, lambda number, frame: handled.set())

    def interrupt():
        with clock.outside():
            signal.pthread_kill(threading.get_ident(), signal.SIGINT)
            in_time = handled.wait(20.0)
        with condition:
            ended.append(in_time)
            condition.notify_all()

    try:
        with condition:
            clock.spawn(interrupt, "interrupt")
            while not ended:
                condition.wait()
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended == [True]


def test_guarded_and_outside_change_nothing():
    clock = WallClock()
    with clock.guarded("plugin"), clock.outside():
        assert clock.now() >= 0.0
    assert wall_seconds() <= wall_seconds()


@pytest.fixture
def clock():
    return SimClock()


def test_a_stopwatch_counts_the_time_of_its_clock(clock):
    watch = Stopwatch(clock)
    clock.sleep(1.5)
    assert watch.elapsed == 1.5
    watch.restart()
    assert watch.elapsed == 0.0


def test_a_paused_stopwatch_stands_still(clock):
    watch = Stopwatch(clock)
    clock.sleep(1.0)
    watch.pause()
    watch.pause()
    clock.sleep(10.0)
    assert watch.paused
    assert watch.elapsed == 1.0
    watch.resume()
    watch.resume()
    clock.sleep(0.5)
    assert not watch.paused
    assert watch.elapsed == pytest.approx(1.5)


def test_a_stopwatch_restarted_in_a_pause_counts_from_the_resume(clock):
    watch = Stopwatch(clock)
    watch.pause()
    clock.sleep(3.0)
    watch.restart()
    clock.sleep(3.0)
    assert watch.elapsed == 0.0
    watch.resume()
    clock.sleep(1.0)
    assert watch.elapsed == pytest.approx(1.0)
