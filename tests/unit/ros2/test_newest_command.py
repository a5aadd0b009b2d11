"""A simulated robot waits for the newest command, and no longer once none can come."""

import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.time.sim_clock import SimClock
from mbf_ros.ros2.running import RosError
from mbf_ros.ros2.simulation.simulated_robot import NewestCommand


def test_a_command_is_waited_for_and_taken_once():
    clock = SimClock()
    newest = NewestCommand(clock)
    assert not newest.wait(0.5) and clock.now() == 0.5
    newest.put(Twist.planar(0.1))
    newest.put(Twist.planar(0.2))
    assert newest.wait(0.5) and clock.now() == 0.5
    assert newest.take() == Twist.planar(0.2) and newest.take() is None


def test_after_a_fault_of_a_callback_nobody_waits_for_commands():
    clock = SimClock()
    newest = NewestCommand(clock)
    newest.fail(KeyError("linear"))
    for ask in (newest.check, lambda: newest.wait(60.0)):
        with pytest.raises(RosError, match=r"KeyError: .*linear"):
            ask()
    assert clock.now() == 0.0


def test_a_fault_ends_a_wait_that_has_begun():
    clock = SimClock()
    newest = NewestCommand(clock)

    def fail():
        clock.sleep(1.0)
        newest.fail(ValueError("no command"))

    clock.spawn(fail, "executor")
    with pytest.raises(RosError, match=r"ValueError: no command"):
        newest.wait(60.0)
    assert clock.now() == 1.0
