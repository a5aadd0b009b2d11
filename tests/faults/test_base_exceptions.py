"""Fault table, rows 1, 4, 8 and 20: code of the user that raises what ``except Exception`` does not catch."""

import asyncio

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_abstract.testing.faulty import Hang, drive
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import ThreadDetached, WallClock
from promises import assert_ended_once, assert_next_goals_work, assert_stops

ERRORS = [SystemExit(3), asyncio.CancelledError("no"), KeyboardInterrupt(), GeneratorExit(), ThreadDetached("liar")]


class Unprintable(BaseException):
    """An exception whose text cannot be had either."""

    def __str__(self):
        raise SystemExit("no text")


class Actor:
    """One kind of plugin, the goal that calls it, and how that goal shall end."""

    def __init__(self, name, goal, outcome):
        self.name, self.goal, self.outcome = name, goal, outcome


ACTORS = [
    Actor("planner", lambda session: GetPathGoal(Pose.planar(3.0, 0.0)), GetPathOutcome.INTERNAL_ERROR),
    Actor("controller", lambda session: ExePathGoal(session.path_to(9.0)), ExePathOutcome.INTERNAL_ERROR),
    Actor("recovery", lambda session: RecoveryGoal(), RecoveryOutcome.INTERNAL_ERROR),
    Actor("refiner", lambda session: RefinePathGoal(session.path_to(9.0)), RefinePathOutcome.INTERNAL_ERROR),
]


@pytest.mark.parametrize("error", [*ERRORS, Unprintable()], ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("actor", ACTORS, ids=lambda actor: actor.name)
def test_whatever_a_plugin_raises_ends_its_goal_and_leaves_its_slot_alive(actor, error):
    with ScriptedSession() as session:
        plugin = getattr(session, actor.name)
        healthy = plugin._answers
        plugin.play(error)
        for _ in range(2):
            handle = session.navigator.send(actor.goal(session))
            result = handle.wait(2.0)
            assert result.outcome == actor.outcome
            assert f"plugin {actor.name!r} raised" in result.message and type(error).__name__ in result.message
            assert_ended_once(session, handle)
        plugin.play(*healthy)
        assert session.navigator.send(actor.goal(session)).wait(60.0).success


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("method", ["set_plan", "is_goal_reached", "cancel"])
def test_every_method_of_a_controller_may_raise_it_while_the_robot_drives(method, error, monkeypatch):
    def boom(self, *arguments):
        raise error

    with ScriptedSession() as session:
        monkeypatch.setattr(type(session.controller), method, boom)
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        handle.cancel()
        result = handle.wait(2.0)
        ended = session.clock.now()
        assert type(error).__name__ in result.message
        session.clock.sleep(2.0)
        assert_stops(session, ended)
        monkeypatch.undo()
        assert_next_goals_work(session)


def test_a_cancel_method_that_raises_it_beside_a_hanging_call_changes_nothing(monkeypatch):
    def boom(self):
        raise SystemExit(3)

    with ScriptedSession(planner_patience=1.0, cancel_grace=0.5) as session:
        monkeypatch.setattr(type(session.planner), "cancel", boom, raising=False)
        hang = Hang(session.clock)
        session.planner.play(hang)
        assert session.navigator.get_path(Pose.planar(3.0, 0.0)).outcome == GetPathOutcome.PAT_EXCEEDED
        assert [event.data["type"] for event in session.recorded(EventKind.FAULT)] == ["SystemExit"]
        hang.release()


class Driver:
    """A driver that answers some calls with ``error``, before it passes on the others."""

    def __init__(self, error):
        self.error = error
        self.robot = None
        self.commands_to_refuse = 0
        self.refuses_odometry = False

    def send_command(self, command):
        if self.commands_to_refuse > 0:
            self.commands_to_refuse -= 1
            raise self.error
        self.robot.send_command(command)

    def odometry(self):
        if self.refuses_odometry:
            raise self.error
        return self.robot.odometry()


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_a_driver_that_raises_it_is_sent_zero_again_by_a_watchdog_that_lives_on(error):
    driver = Driver(error)
    with ScriptedSession(robot=driver, command_timeout=0.2) as session:
        driver.robot = session.robot
        session.controller.play(drive(), RuntimeError("stop"))
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(0.02)
        driver.commands_to_refuse = 3  # the zero at the end, and two of the watchdog's
        assert handle.wait(2.0).outcome == ExePathOutcome.INTERNAL_ERROR
        session.clock.sleep(2.0)
        assert driver.commands_to_refuse == 0
        assert session.robot.command.is_stopped()
        assert_next_goals_work(session)


@pytest.mark.parametrize("error", ERRORS[:-1], ids=lambda error: type(error).__name__)
def test_a_driver_whose_odometry_raises_it_ends_the_goal_and_the_next_one_works(error):
    driver = Driver(error)
    with ScriptedSession(robot=driver, controller_patience=0.5) as session:
        driver.robot = session.robot
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        driver.refuses_odometry = True
        result = handle.wait(2.0)
        assert type(error).__name__ in result.message
        assert session.robot.command.is_stopped()
        driver.refuses_odometry = False
        assert_next_goals_work(session)


def test_on_the_wall_clock_the_slot_survives_too():
    with ScriptedSession(clock=WallClock()) as session:
        session.planner.play(SystemExit(3))
        assert (
            session.navigator.send(GetPathGoal(Pose.planar(3.0, 0.0))).wait(5.0).outcome
            == GetPathOutcome.INTERNAL_ERROR
        )
        assert_next_goals_work(session)


class Leaver:
    """A sink of events that raises at the first event of a kind."""

    def __init__(self, kind, error):
        self.kind, self.error = kind, error

    def write(self, event):
        if event.kind is self.kind:
            raise self.error

    def close(self):
        raise self.error


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("kind", [EventKind.GOAL_STARTED, EventKind.PLUGIN_CALL_ENDED, EventKind.GOAL_FINISHED])
def test_a_sink_of_events_that_raises_it_is_removed_and_the_goal_ends(kind, error):
    with ScriptedSession() as session:
        session.events.add_sink(Leaver(kind, error))
        handle = session.navigator.send(GetPathGoal(Pose.planar(3.0, 0.0)))
        assert handle.wait(2.0).success
        assert [event.data["sink"] for event in session.recorded(EventKind.SINK_FAILED)] == ["Leaver"]
        assert_ended_once(session, handle)
        assert_next_goals_work(session)
