"""The velocity gate and a driver that blocks, raises anything, or is handed what is no command."""

import math

import pytest

from mbf_abstract.drive.commands import command_problem, stands_still
from mbf_abstract.drive.velocity_gate import VelocityGate
from mbf_abstract.drive.velocity_limits import VelocityLimits
from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import AckermannCommand, Twist
from mbf_abstract.time.clock import Priority
from mbf_abstract.time.sim_clock import SimClock

FORWARD = Twist.planar(0.5)


class MoodyRobot:
    """Writes a command down when the call with it returns; blocks or raises as long as the test says."""

    def __init__(self, clock):
        self.clock, self.commands, self.inside = clock, [], 0
        self.blocks = lambda command: False
        self.error = None
        self._condition = clock.condition()

    def send_command(self, command):
        self.inside += 1
        with self._condition:
            while self.blocks(command):
                self._condition.wait()
        self.inside -= 1
        if self.error is not None:
            raise self.error
        self.commands.append((round(self.clock.now(), 6), command))

    def odometry(self):
        return None

    def free(self):
        with self._condition:
            self.blocks = lambda command: False
            self._condition.notify_all()


@pytest.fixture
def scene():
    class Scene:
        clock = SimClock()
        memory = MemorySink()

        def spawn(self, work):
            return self.clock.spawn(work, "owner", Priority.WORKER)

    scene = Scene()
    scene.robot = MoodyRobot(scene.clock)
    events = EventBus(scene.clock.now, [scene.memory])
    scene.gate = VelocityGate(scene.robot, scene.clock, events, VelocityLimits(), command_timeout=0.5)
    return scene


def test_zero_reaches_the_robot_beside_a_command_that_blocks_and_once_more_after_it(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    scene.robot.blocks = lambda command: not stands_still(command)
    scene.spawn(lambda: lease.send(FORWARD))
    scene.clock.sleep(2.0)
    assert scene.robot.commands == [(0.0, FORWARD), (0.5, Twist())]
    scene.robot.free()
    scene.clock.sleep(1.0)
    assert scene.robot.commands[2:] == [(2.0, FORWARD), (2.0, Twist())]  # the late command is not the last word


def test_nobody_but_the_sender_waits_for_a_driver_that_blocks(scene):
    lease = scene.gate.acquire("a")
    scene.robot.blocks = lambda command: True
    scene.spawn(lambda: lease.send(FORWARD))
    scene.clock.sleep(0.1)
    lease.ask_stop("paused")
    lease.revoke("its goal has ended")
    other = scene.gate.acquire("b")
    assert other is not None
    assert scene.clock.now() == pytest.approx(0.1)
    scene.gate.close()
    assert scene.clock.now() <= 0.6 + 1e-9
    scene.robot.free()
    scene.clock.sleep(1.0)
    assert scene.robot.commands[-1][1] == Twist()
    assert scene.robot.inside == 0


def test_no_motion_is_begun_while_an_earlier_command_has_not_come_back(scene):
    lease = scene.gate.acquire("a")
    scene.robot.blocks = lambda command: not stands_still(command)
    scene.spawn(lambda: lease.send(FORWARD))
    scene.clock.sleep(1.0)
    lease.revoke("hangs")
    other = scene.gate.acquire("b")
    assert not other.send(Twist.planar(0.9))
    assert other.problem == "the robot's send_command() has not returned from an earlier command"
    scene.robot.free()
    scene.clock.sleep(0.1)
    assert other.send(Twist.planar(0.9))
    assert scene.robot.commands[-1][1] == Twist.planar(0.9)


def test_a_stop_that_blocks_is_sent_again_by_the_watchdog(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    first = []
    scene.robot.blocks = lambda command: first.append(command) is None and len(first) == 1
    scene.spawn(lease.stop)
    scene.clock.sleep(2.0)
    assert scene.robot.commands == [(0.0, FORWARD), (0.5, Twist())]


def test_a_revoked_lease_stops_the_robot_at_once_from_the_watchdogs_thread(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    lease.revoke("the controller hangs")
    assert not lease.active
    scene.clock.sleep(0.0)
    assert scene.robot.commands == [(0.0, FORWARD), (0.0, Twist())]
    stopped = scene.memory.of_kind(EventKind.ROBOT_STOPPED)
    assert [event.data["reason"] for event in stopped] == ["the controller hangs"]


@pytest.mark.parametrize("error", [OSError("unplugged"), SystemExit(3), KeyboardInterrupt(), GeneratorExit()], ids=repr)
def test_whatever_a_driver_raises_the_watchdog_lives_on_and_stops_the_robot(scene, error):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    scene.robot.error = error
    sent = []
    scene.clock.spawn(lambda: sent.append(lease.send(FORWARD)), "worker")
    scene.clock.sleep(0.0)
    assert sent == [False]
    assert type(error).__name__ in lease.problem
    scene.clock.sleep(1.2)
    scene.robot.error = None
    scene.clock.sleep(1.0)
    assert scene.robot.commands[1:] == [(1.5, Twist())]


def test_sends_that_all_raise_do_not_keep_the_watchdog_from_stopping_the_robot(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    raised = []

    def refuse_motion(command):
        if not stands_still(command):
            raised.append(command)
            raise OSError("busy")
        return False

    scene.robot.blocks = refuse_motion
    for _ in range(20):
        scene.clock.sleep(0.05)
        lease.send(FORWARD)
    assert len(raised) == 20
    assert scene.robot.commands[1] == (0.5, Twist())


def test_a_closed_gate_tries_a_few_times_to_stop_a_driver_that_raises_and_then_ends(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    scene.robot.error = OSError("unplugged")
    scene.gate.close()
    scene.clock.sleep(10.0)
    assert len(scene.memory.of_kind(EventKind.FAULT)) == 4
    assert scene.clock.thread_names == ["main"]


# ------------------------------------------------------------------------------------------ what a command is
class Duck:
    """Looks like a twist and is none."""

    linear = (0.1, 0.0, 0.0)
    angular = (0.0, 0.0, 0.0)
    vx, vy, wz = 0.1, 0.0, 0.0


def written(twist, **fields):
    """Return a frozen value that was written to all the same."""
    for name, value in fields.items():
        object.__setattr__(twist, name, value)
    return twist


NO_COMMANDS = {
    "duck": Duck(),
    "none": None,
    "tuple": (0.5, 0.0, 0.0),
    "inf": written(Twist(), linear=(math.inf, 0.0, 0.0)),
    "nan": written(Twist(), angular=(0.0, 0.0, math.nan)),
    "text": written(Twist(), linear=("fast", 0.0, 0.0)),
    "car": written(AckermannCommand(), speed=math.nan),
}


@pytest.mark.parametrize("command", NO_COMMANDS.values(), ids=NO_COMMANDS)
def test_what_is_no_finite_command_is_dropped_and_the_robot_stops(scene, command):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    assert not lease.send(command)
    assert scene.robot.commands == [(0.0, FORWARD), (0.0, Twist())]
    dropped = scene.memory.of_kind(EventKind.COMMAND_DROPPED)
    assert dropped[0].data["reason"] == lease.problem == command_problem(command)


def test_a_coroutine_for_an_answer_is_a_command_that_did_not_arrive(scene):
    async def send_command(command):
        pass

    scene.robot.send_command = lambda command: send_command(command)
    lease = scene.gate.acquire("a")
    assert not lease.send(FORWARD)
    assert "coroutine" in lease.problem


LIMITS = VelocityLimits(max_vel_z=0.1, max_vel_roll=0.2, max_vel_pitch=0.4)


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (Twist((1.0, 0.0, -0.2)), Twist((0.5, 0.0, -0.1))),
        (Twist((1.0, 0.0, 0.0), (0.8, 0.0, 0.4)), Twist((0.25, 0.0, 0.0), (0.2, 0.0, 0.1))),
        (Twist((1.0, 0.0, 0.0), (0.0, -0.8, 0.0)), Twist((0.5, 0.0, 0.0), (0.0, -0.4, 0.0))),
    ],
)
def test_vertical_speed_roll_and_pitch_have_limits(command, expected):
    assert LIMITS.apply(command) == expected


@pytest.mark.parametrize("command", [Twist((0.0, 0.0, 0.3)), Twist(angular=(0.3, 0.0, 0.0)), Twist((1e-9, 0.0, 0.0))])
def test_any_motion_at_all_is_stopped_by_the_watchdog(scene, command):
    scene.gate.acquire("a").send(command)
    scene.clock.sleep(2.0)
    assert scene.robot.commands == [(0.0, command), (0.5, Twist())]


def test_a_new_timeout_holds_from_the_moment_it_is_set(scene):
    lease = scene.gate.acquire("a")
    scene.gate.command_timeout = 2.0
    lease.send(FORWARD)
    scene.clock.sleep(1.0)
    scene.gate.command_timeout = 1.2
    scene.clock.sleep(2.0)
    assert scene.robot.commands == [(0.0, FORWARD), (1.2, Twist())]


def test_a_command_waits_for_the_end_of_an_earlier_call_that_is_not_long(scene):
    lease = scene.gate.acquire("a")
    scene.robot.blocks = lambda command: True
    scene.spawn(lambda: lease.send(FORWARD))
    scene.clock.sleep(0.1)
    scene.spawn(lambda: (scene.clock.sleep(0.2), scene.robot.free()))
    assert lease.send(Twist.planar(0.2))
    assert scene.clock.now() == pytest.approx(0.3)
    assert scene.robot.commands[-1][1] == Twist.planar(0.2)


def test_with_the_gate_of_a_robot_that_stands_its_watchdog_ends(scene):
    scene.clock.sleep(1.0)
    assert "velocity watchdog" in scene.clock.thread_names
    scene.gate.close()
    scene.clock.sleep(0.1)
    assert "velocity watchdog" not in scene.clock.thread_names


@pytest.mark.parametrize("how", ["revoke", "ask_stop"])
def test_who_takes_a_lease_away_or_asks_for_a_stop_does_not_wait_for_the_timeout(scene, how):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    scene.clock.sleep(0.1)
    getattr(lease, how)("enough")
    scene.clock.sleep(1.0)
    assert scene.robot.commands == [(0.0, FORWARD), (0.1, Twist())]


def test_what_is_no_command_through_a_lease_that_is_over_does_not_stop_who_drives_now(scene):
    old = scene.gate.acquire("a")
    old.release()
    scene.gate.acquire("b").send(FORWARD)
    assert not old.send("duck")
    assert scene.robot.commands[-1] == (0.0, FORWARD)
