"""Our clock on ROS time: it never runs backwards, and waits end when ROS time has come so far."""

import threading

from hypothesis import given
from hypothesis import strategies as st

from mbf_ros.ros2.clock import RosClock, SimulatedRosClock

TIMES = st.lists(st.floats(0.0, 1e5), min_size=1, max_size=30)


@given(first=st.floats(0.0, 1e5), times=TIMES)
def test_simulated_time_adds_up_what_passes_forwards(first, times):
    clock, jumps, elapsed, last = SimulatedRosClock(first), [], 0.0, first
    clock.on_jump.append(jumps.append)
    for time in times:
        clock.follow(time)
        elapsed, last = elapsed + max(0.0, time - last), time
        assert abs(clock.now() - elapsed) < 1e-6
        assert abs(clock.epoch + clock.now() - time) < 1e-6
    assert len(jumps) == sum(later < earlier for earlier, later in zip([first, *times], times, strict=False))


def test_a_wait_ends_when_simulated_time_has_come():
    clock = SimulatedRosClock(100.0)
    waits, woken = threading.Event(), []

    def wait():
        condition = clock.condition()
        with condition:
            waits.set()
            while clock.now() < 2.0:
                condition.wait(2.0 - clock.now())
        woken.append(clock.now())

    thread = clock.spawn(wait, "waiter")
    assert waits.wait(60.0)
    clock.follow(101.0)
    assert thread.is_alive()
    clock.follow(102.5)
    assert thread.join(60.0)
    assert woken == [2.5]


def test_a_wait_ends_at_a_notification_too():
    clock = SimulatedRosClock(0.0)
    condition, waits, answers = clock.condition(), threading.Event(), []

    def wait():
        with condition:
            waits.set()
            answers.append(condition.wait(5.0))

    thread = clock.spawn(wait, "waiter")
    assert waits.wait(60.0)
    with condition:
        condition.notify_all()
    assert thread.join(60.0)
    assert answers == [True]


def test_a_thread_that_sleeps_wakes_after_simulated_seconds():
    clock = SimulatedRosClock(0.0)
    thread = clock.spawn(lambda: clock.sleep(1.0), "sleeper")
    time = 0.0
    while not thread.join(0.01):
        time += 0.1
        clock.follow(time)
    assert time > 0.95


def test_time_that_stands_in_ends_waits_and_leaves_ros_time_where_it_is():
    clock, jumps = SimulatedRosClock(100.0), []
    clock.on_jump.append(jumps.append)
    clock.follow(101.0)
    clock.stand_in(0.5, after=3600.0)
    assert clock.now() == 1.0
    thread = clock.spawn(lambda: clock.sleep_until(2.0), "sleeper")
    clock.stand_in(1.5, after=0.0)
    assert thread.join(60.0)
    assert (clock.now(), clock.epoch + clock.now()) == (2.5, 101.0)
    clock.follow(101.25)
    assert (clock.now(), clock.epoch + clock.now()) == (2.75, 101.25)
    assert jumps == []


class SetClock(RosClock):
    """Shows the time that the test sets."""

    time = 0.0

    def now(self):
        return self.time


def test_the_epoch_follows_a_calendar_that_is_set_and_ours_goes_on():
    clock, jumps = SetClock(1000.0), []
    clock.on_jump.append(jumps.append)
    clock.time = 5.0
    clock.follow(1005.25)  # corrected
    assert jumps == [] and clock.epoch == 1000.25
    clock.follow(945.25)
    assert jumps == [-60.0]
    assert clock.epoch == 940.25 and clock.now() == 5.0


def test_equal_ros_times_stay_equal_while_the_calendar_is_right():
    clock = SetClock(1000.0)
    clock.time = 5.0
    clock.follow(1005.001)
    assert clock.epoch == 1000.0
