"""The velocity gate: one lease, nothing after its end, limits, watchdog, pause, close, and drivers that raise."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.drive.velocity_gate import VelocityGate
from mbf_abstract.drive.velocity_limits import VelocityLimits
from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import AckermannCommand, Twist
from mbf_abstract.time.sim_clock import SimClock

FORWARD = Twist.planar(0.5)


class RecordingRobot:
    """Keeps every command with its time; raises while ``broken``."""

    def __init__(self, clock):
        self.clock = clock
        self.commands = []
        self.broken = False

    def send_command(self, command):
        if self.broken:
            raise OSError("the cable is out")
        self.commands.append((round(self.clock.now(), 6), command))

    def odometry(self):
        return None


@pytest.fixture
def scene():
    class Scene:
        clock = SimClock()
        memory = MemorySink()

    scene = Scene()
    scene.robot = RobotWithGate = RecordingRobot(scene.clock)
    events = EventBus(scene.clock.now, [scene.memory])
    scene.gate = VelocityGate(RobotWithGate, scene.clock, events, VelocityLimits(), command_timeout=0.5)
    return scene


def test_only_one_lease_exists_at_a_time(scene):
    lease = scene.gate.acquire("first")
    assert lease.active
    assert scene.gate.holder == "first"
    assert scene.gate.acquire("second") is None
    lease.release()
    assert scene.gate.holder == ""
    assert scene.gate.acquire("second") is not None


def test_a_command_through_the_lease_reaches_the_robot(scene):
    assert scene.gate.acquire("a").send(FORWARD)
    assert scene.robot.commands == [(0.0, FORWARD)]
    assert scene.gate.last_command == FORWARD


def test_the_end_of_a_lease_stops_the_robot_and_later_commands_are_dropped(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    lease.release()
    lease.release()
    assert not lease.active
    assert not lease.send(FORWARD)
    lease.stop()
    lease.pause()
    assert [command for _, command in scene.robot.commands] == [FORWARD, Twist()]
    dropped = scene.memory.of_kind(EventKind.COMMAND_DROPPED)
    assert [event.data["reason"] for event in dropped] == ["the lease is over"]


def test_an_old_lease_can_not_disturb_the_new_one(scene):
    old = scene.gate.acquire("old")
    old.release()
    new = scene.gate.acquire("new")
    new.send(FORWARD)
    for attack in (old.stop, old.pause, old.release, lambda: old.send(Twist.planar(-9.0))):
        attack()
    assert new.active and not new.paused
    assert scene.robot.commands[-1] == (0.0, FORWARD)


def test_the_watchdog_stops_a_robot_whose_commands_stop_coming(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    scene.clock.sleep(0.3)
    lease.send(FORWARD)
    scene.clock.sleep(5.0)
    assert scene.robot.commands == [(0.0, FORWARD), (0.3, FORWARD), (0.8, Twist())]
    assert lease.active
    assert lease.send(FORWARD)
    scene.clock.sleep(1.0)
    assert scene.robot.commands[-2:] == [(5.3, FORWARD), (5.8, Twist())]


def test_the_watchdog_also_ends_a_motion_that_a_release_let_run(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    lease.release(stop=False)
    assert scene.robot.commands == [(0.0, FORWARD)]
    scene.clock.sleep(1.0)
    assert scene.robot.commands[1:] == [(0.5, Twist())]


def test_stop_keeps_the_lease(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    lease.stop()
    lease.stop()  # the robot stands already: no second command, no second event
    assert scene.robot.commands == [(0.0, FORWARD), (0.0, Twist())]
    assert lease.send(FORWARD)


def test_every_stop_and_every_change_of_the_lease_is_recorded_once(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    lease.stop()
    lease.stop()
    lease.send(FORWARD)
    lease.pause()
    lease.resume()
    lease.release(reason="done")
    lease.release()
    scene.gate.close("the end")
    scene.gate.close()
    reported = [(event.kind, event.data) for event in scene.memory.events]
    assert reported == [
        (EventKind.LEASE_GRANTED, {"holder": "a"}),
        (EventKind.ROBOT_STOPPED, {"reason": "asked by the lease's owner"}),
        (EventKind.ROBOT_STOPPED, {"reason": "paused"}),
        (EventKind.LEASE_REVOKED, {"holder": "a", "reason": "done"}),
        (EventKind.GATE_CLOSED, {"holder": "", "reason": "the end"}),
    ]


def test_a_paused_lease_holds_the_robot_until_it_is_resumed(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    lease.pause()
    lease.pause()
    assert not lease.send(FORWARD)
    assert scene.robot.commands[-1][1] == Twist()
    lease.resume()
    assert lease.send(FORWARD)
    assert scene.memory.of_kind(EventKind.COMMAND_DROPPED)[0].data["reason"] == "the lease is paused"


def test_a_stop_asked_of_the_gate_comes_at_once_and_leaves_the_lease(scene):
    lease = scene.gate.acquire("a")
    scene.gate.ask_stop("nothing moves yet")
    lease.send(FORWARD)
    scene.gate.ask_stop("no odometry")
    scene.clock.sleep(0.01)
    assert lease.send(FORWARD)
    assert scene.robot.commands == [(0.0, FORWARD), (0.0, Twist()), (0.01, FORWARD)]
    assert [event.data["reason"] for event in scene.memory.of_kind(EventKind.ROBOT_STOPPED)] == ["no odometry"]


def test_a_closed_gate_stops_the_robot_for_good(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    scene.gate.close("test")
    scene.gate.close("twice")
    assert not lease.send(FORWARD)
    assert scene.gate.acquire("b") is None
    scene.clock.sleep(2.0)
    assert [command for _, command in scene.robot.commands] == [FORWARD, Twist()]
    closed = scene.memory.of_kind(EventKind.GATE_CLOSED)
    assert [event.data for event in closed] == [{"holder": "a", "reason": "test"}]


def test_a_driver_that_raises_is_an_event_and_the_stop_is_tried_again(scene):
    lease = scene.gate.acquire("a")
    lease.send(FORWARD)
    scene.robot.broken = True
    assert not lease.send(FORWARD)
    lease.release()
    scene.clock.sleep(2.2)
    scene.robot.broken = False
    scene.clock.sleep(1.0)
    assert scene.robot.commands == [(0.0, FORWARD), (2.5, Twist())]
    assert {event.data["message"] for event in scene.memory.of_kind(EventKind.FAULT)} == {"the cable is out"}


def test_a_stopped_car_keeps_its_wheels_turned(scene):
    lease = scene.gate.acquire("a")
    lease.send(AckermannCommand(1.0, 0.3))
    lease.release()
    assert scene.robot.commands[-1][1] == AckermannCommand(0.0, 0.3)


# ------------------------------------------------------------------------------------------------- limits
LIMITS = VelocityLimits(max_vel_x=1.0, min_vel_x=-0.2, max_vel_y=0.5, max_vel_theta=2.0, max_steering_angle=0.6)
speeds = st.floats(-100.0, 100.0).map(lambda value: round(value, 6))


def _naive_limit(vx, vy, wz):
    """Shrink in ten thousand steps until everything fits."""
    factors = [1.0, 1.0 / (vx if vx > 0 else -vx / 0.2) if vx else 1.0]
    factors += [0.5 / abs(vy) if vy else 1.0, 2.0 / abs(wz) if wz else 1.0]
    factor = min(factors)
    return vx * factor, vy * factor, wz * factor


@settings(deadline=None)
@given(speeds, speeds, speeds)
def test_limits_scale_the_whole_command_so_that_its_direction_is_kept(vx, vy, wz):
    limited = LIMITS.apply(Twist.planar(vx, vy, wz))
    assert (limited.vx, limited.vy, limited.wz) == pytest.approx(_naive_limit(vx, vy, wz), abs=1e-9)
    assert -0.2 - 1e-12 <= limited.vx <= 1.0 + 1e-12
    assert abs(limited.vy) <= 0.5 + 1e-12 and abs(limited.wz) <= 2.0 + 1e-12
    assert limited.vx * wz == pytest.approx(limited.wz * vx, abs=1e-6)


@settings(deadline=None)
@given(speeds, st.floats(-math.pi, math.pi))
def test_an_ackermann_command_is_limited_in_speed_and_angle(speed, angle):
    limited = LIMITS.apply(AckermannCommand(speed, angle))
    assert limited == AckermannCommand(min(max(speed, -0.2), 1.0), min(max(angle, -0.6), 0.6))


def test_a_command_within_the_limits_is_passed_as_it_is():
    command = Twist.planar(1.0, -0.5, 2.0)
    assert LIMITS.apply(command) is command
    car = AckermannCommand(0.5, 0.1)
    assert LIMITS.apply(car) is car


def test_a_robot_that_can_not_reverse_stands_when_commanded_to():
    assert VelocityLimits(min_vel_x=0.0).apply(Twist.planar(-0.5, wz=0.3)) == Twist()


@settings(deadline=None)
@given(speeds, speeds, st.floats(0.05, 20.0))
def test_a_curve_tighter_than_the_turning_circle_is_widened_at_the_same_speed(vx, wz, radius):
    limited = VelocityLimits(min_turning_radius=radius).apply(Twist.planar(vx, wz=wz))
    assert limited.vx == vx
    assert abs(limited.wz) == pytest.approx(min(abs(wz), abs(vx) / radius), rel=1e-5)
    assert limited.wz * wz >= 0.0


@settings(deadline=None)
@given(speeds, speeds, st.floats(0.05, 20.0))
def test_no_limit_that_is_applied_with_a_turning_circle_breaks_it(vx, wz, radius):
    limits = VelocityLimits(max_vel_x=1.0, min_vel_x=-0.2, max_vel_theta=2.0, min_turning_radius=radius)
    limited = limits.apply(Twist.planar(vx, wz=wz))
    assert -0.2 - 1e-12 <= limited.vx <= 1.0 + 1e-12 and abs(limited.wz) <= 2.0 + 1e-12
    assert abs(limited.wz) * radius <= abs(limited.vx) * (1.0 + 2e-6) + 1e-12


def test_a_robot_with_a_turning_circle_does_not_turn_on_the_spot():
    assert VelocityLimits(min_turning_radius=0.5).apply(Twist.planar(wz=1.0)) == Twist()


def test_a_curve_on_the_turning_circle_itself_is_passed_as_it_is():
    command = Twist.planar(0.3, wz=0.3 / 0.7)
    assert VelocityLimits(min_turning_radius=0.7).apply(command) is command


def test_a_limited_command_is_sent_and_recorded(scene):
    scene.gate.limits = LIMITS
    scene.gate.acquire("a").send(Twist.planar(2.0, wz=1.0))
    assert scene.robot.commands == [(0.0, Twist.planar(1.0, wz=0.5))]
    clamped = scene.memory.of_kind(EventKind.COMMAND_CLAMPED)[0]
    assert clamped.data == {"requested": [2.0, 0.0, 1.0], "sent": [1.0, 0.0, 0.5]}
