"""A connection is opened again after rising times, and sends nothing that was meant for an earlier one."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.time.sim_clock import SimClock
from mbf_ros.rosbridge_robot.connection import Backoff, Connection, NotConnectedError
from mbf_ros.rosbridge_robot.dialing import LinkError


class Lost(Exception):
    """The end of a scripted WebSocket."""


class ScriptedSocket:
    """A WebSocket on simulated time that can be lost, and whose sending can be held up."""

    def __init__(self, clock):
        self.sent, self.lost, self.held_up, self._condition = [], False, False, clock.condition()

    def set(self, **state):
        with self._condition:
            vars(self).update(state)
            self._condition.notify_all()

    def send(self, message):
        with self._condition:
            while self.held_up and not self.lost:
                self._condition.wait()
            if self.lost:
                raise Lost("lost")
            self.sent.append(message)

    def recv(self):
        with self._condition:
            while not self.lost:
                self._condition.wait()
        raise Lost("cut")

    def close(self):
        self.set(lost=True)


class Site:
    """A connection to a robot that answers or not."""

    def __init__(self):
        self.clock, self.sockets, self.dialed, self.changes, self.answers = SimClock(), [], [], [], True
        self.faults, self.greeting, self.on_change = [], lambda: ["hello"], self.changes.append
        self.connection = Connection(
            "data",
            self.dial,
            self.clock,
            Backoff(0.25, 8.0),
            lambda: self.greeting(),
            lambda _: None,
            lambda problem: self.on_change(problem),
            self.faults.append,
        )

    def dial(self):
        self.dialed.append(self.clock.now())
        if not self.answers:
            raise LinkError("nobody there")
        self.sockets.append(ScriptedSocket(self.clock))
        return self.sockets[-1]


@pytest.fixture
def site():
    made = Site()
    yield made
    made.connection.close()
    made.clock.sleep(1.0)


def test_the_first_connection_must_succeed(site):
    site.answers = False
    with pytest.raises(LinkError, match="nobody there"):
        site.connection.open()
    with pytest.raises(NotConnectedError, match="no connection for data: not connected yet"):
        site.connection.answer("x")


def test_tries_become_rarer_and_begin_anew_after_a_connection_that_lasted(site):
    site.connection.open()
    site.clock.sleep(100.0)
    site.answers = False
    site.sockets[0].set(lost=True)
    site.clock.sleep(33.0)
    waits = [later - earlier for earlier, later in zip([100.0, *site.dialed[1:]], site.dialed[1:], strict=False)]
    assert waits == pytest.approx([0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 8.0, 8.0])
    assert site.changes == ["the connection was lost (cut)", "nobody there"]
    site.answers = True
    site.clock.sleep(20.0)
    assert site.changes[-1] == "" and not site.connection.problem
    site.answers, tries = False, len(site.dialed)
    lost = site.clock.now()
    site.sockets[-1].set(lost=True)
    site.clock.sleep(1.0)
    assert site.dialed[tries] - lost == pytest.approx(0.25)


def test_what_waited_when_the_connection_was_lost_is_never_sent(site):
    site.connection.open()
    site.clock.sleep(0.1)
    site.sockets[0].set(held_up=True)
    for number in range(3):
        site.connection.newest("cmd_vel", f"command {number}")
        site.connection.answer(f"answer {number}")
    assert not site.connection.wait_until_sent(1.0)
    site.sockets[0].set(lost=True)
    site.clock.sleep(0.1)
    with pytest.raises(NotConnectedError, match=r"the connection was lost \(cut\)"):
        site.connection.newest("cmd_vel", "command 3")
    site.clock.sleep(1.0)
    site.connection.newest("cmd_vel", "command 4")
    assert site.connection.wait_until_sent(1.0)
    assert [one.sent for one in site.sockets] == [["hello"], ["hello", "command 4"]]


def test_only_the_newest_command_waits_behind_one_that_is_held_up(site):
    site.connection.open()
    site.clock.sleep(0.1)
    site.sockets[0].set(held_up=True)
    for number in range(5):
        site.connection.newest("cmd_vel", f"command {number}")
        site.clock.sleep(0.1)
    site.sockets[0].set(held_up=False)
    assert site.connection.wait_until_sent(1.0)
    assert site.sockets[0].sent == ["hello", "command 0", "command 4"]


def test_a_robot_that_reads_nothing_is_given_up(site):
    site.connection.open()
    site.clock.sleep(0.1)
    site.sockets[0].set(held_up=True)
    for number in range(1002):
        site.connection.answer(str(number))
    site.clock.sleep(0.1)
    assert site.changes == ["the robot reads too slowly: 1000 frames wait"]


@pytest.mark.parametrize("raises", ["greeting", "on_change"])
def test_what_a_greeting_or_a_listener_raises_is_a_fault_and_the_connection_is_opened_anew(site, raises):
    site.connection.open()
    site.clock.sleep(0.1)
    before = getattr(site, raises)

    def fail(*_):
        raise OSError("the disk is full")

    setattr(site, raises, fail)
    site.sockets[0].set(lost=True)
    site.clock.sleep(1.0)
    assert site.connection.problem and all(one.lost for one in site.sockets)
    assert len(site.sockets) > 1 and {str(one) for one in site.faults} == {"the disk is full"}
    setattr(site, raises, before)
    site.clock.sleep(20.0)
    assert not site.connection.problem and site.sockets[-1].sent == ["hello"] and site.changes[-1] == ""


def test_a_first_greeting_that_raises_leaves_no_socket_open(site):
    site.greeting = lambda: [][0]
    with pytest.raises(IndexError):
        site.connection.open()
    assert site.sockets[0].lost


def test_a_closed_connection_is_not_opened_again(site):
    site.connection.open()
    site.clock.sleep(0.1)
    site.connection.close()
    site.clock.sleep(60.0)
    assert len(site.dialed) == 1 and site.changes == []


@given(st.floats(0.01, 1.0), st.floats(1.0, 60.0), st.integers(1, 20))
def test_times_between_tries_double_up_to_the_longest(first, longest, count):
    backoff = Backoff(first, longest)
    assert [backoff.next() for _ in range(count)] == [min(first * 2.0**number, longest) for number in range(count)]
