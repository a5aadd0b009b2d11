"""Fault table, rows 1, 4, 5, 8, 20 and 35: every hook of every interface, found by introspection, with every fault."""

import asyncio
import inspect

import pytest

from mbf_abstract.drive.robot import Robot
from mbf_abstract.execution.runtime import MapHooks
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.plugins import PLUGIN_BASES, PluginKind
from mbf_abstract.testing.faulty import Hang
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work, assert_stops

LIMITS = {"planner_patience": 2.0, "controller_patience": 2.0, "recovery_patience": 2.0, "cancel_grace": 0.5}
ENDS_WITHIN = 8.0  # s: driving, patience, grace, and a call that is late by LATE
LATE = 3.0  # s
GOALS = {
    PluginKind.PLANNER: lambda session: GetPathGoal(Pose.planar(3.0, 0.0)),
    PluginKind.CONTROLLER: lambda session: ExePathGoal(session.path_to(1.0)),
    PluginKind.RECOVERY: lambda session: RecoveryGoal(),
    PluginKind.REFINER: lambda session: RefinePathGoal(session.path_to(3.0)),
}
CALLED_OTHERWISE = {"parameters_changed"}  # by the client's own thread, which gets what it raises


def raising(error):
    def fault(healthy, clock):
        def call(*arguments, **keywords):
            raise error

        return call

    return fault


def answering(answer):
    return lambda healthy, clock: lambda *arguments, **keywords: answer


def hanging(healthy, clock):
    hang = Hang(clock)

    def call(*arguments, **keywords):
        return hang(None)

    call.release = hang.release
    return call


def late(healthy, clock):
    def call(*arguments, **keywords):
        clock.sleep(LATE)
        return healthy(*arguments, **keywords)

    return call


FAULTS = {
    "Exception": raising(RuntimeError("broken")),
    "SystemExit": raising(SystemExit(3)),
    "KeyboardInterrupt": raising(KeyboardInterrupt()),
    "CancelledError": raising(asyncio.CancelledError("no")),
    "NaN": answering(float("nan")),
    "wrong type": answering(object()),
    "hang": hanging,
    "late": late,
}


def hooks(interface):
    """Names of the public methods of an interface, inherited ones included."""
    return [
        name
        for name, _ in inspect.getmembers(interface, inspect.isfunction)
        if not name.startswith("_") and name not in CALLED_OTHERWISE
    ]


PLUGIN_HOOKS = [(kind, name) for kind, base in PLUGIN_BASES.items() for name in hooks(base)]


class PassingOn:
    """A driver in front of the session's own."""

    def __init__(self):
        self.robot = None

    def send_command(self, command):
        if self.robot is not None:
            self.robot.send_command(command)

    def odometry(self):
        return self.robot.odometry() if self.robot is not None else None


def drive_with(session, owner, hook, fault, goal, monkeypatch):
    """Send a goal while ``hook`` of ``owner`` is at fault, cancel it on its way; healthy again, the next ones work."""
    faulty = FAULTS[fault](getattr(owner, hook), session.clock)
    monkeypatch.setattr(owner, hook, faulty)
    handle = session.navigator.send(goal)
    session.clock.sleep(1.0)
    handle.cancel()
    begun = session.clock.now()
    handle.wait(ENDS_WITHIN)
    assert handle.done, f"{handle.status} after {session.clock.now() - begun:.2f} s"
    assert_ended_once(session, handle)
    monkeypatch.undo()
    getattr(faulty, "release", lambda: None)()
    ended = session.clock.now()
    session.clock.sleep(LATE + 1.0)
    if hook == "send_command":
        assert (
            session.robot.command.is_stopped()
        )  # the driver holds a command back as long as it likes; zero follows it
    else:
        assert_stops(session, ended)
    assert_next_goals_work(session)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize(("kind", "hook"), PLUGIN_HOOKS, ids=lambda value: getattr(value, "name", value))
def test_every_hook_of_every_plugin_keeps_the_promises(kind, hook, fault, monkeypatch):
    with ScriptedSession(**LIMITS) as session:
        plugin = getattr(session, kind.name.lower())
        drive_with(session, plugin, hook, fault, GOALS[kind](session), monkeypatch)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("hook", hooks(Robot))
def test_every_hook_of_a_driver_keeps_the_promises(hook, fault, monkeypatch):
    driver = PassingOn()
    with ScriptedSession(robot=driver, **LIMITS) as session:
        driver.robot = session.robot
        drive_with(session, driver, hook, fault, ExePathGoal(session.path_to(1.0)), monkeypatch)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("hook", hooks(MapHooks))
def test_every_hook_of_a_map_keeps_the_promises(hook, fault, monkeypatch):
    with ScriptedSession(**LIMITS) as session:
        drive_with(session, session.server, hook, fault, ExePathGoal(session.path_to(1.0)), monkeypatch)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("method", ["add_done_callback", "add_feedback_callback"])
def test_callbacks_at_fault_hold_up_nothing(method, fault):
    with ScriptedSession(**LIMITS) as session:
        faulty = FAULTS[fault](lambda *arguments: None, session.clock)
        handle = session.navigator.send(ExePathGoal(session.path_to(1.0)))
        getattr(handle, method)(faulty)
        assert handle.wait(ENDS_WITHIN).success
        assert_ended_once(session, handle)
        assert_next_goals_work(session)
        getattr(faulty, "release", lambda: None)()


def test_hooks_are_found_and_none_is_forgotten():
    assert len(PLUGIN_HOOKS) >= 11
    assert set(hooks(Robot)) == {"send_command", "odometry"}
    assert set(GOALS) == set(PLUGIN_BASES)
    assert hooks(MapHooks)
