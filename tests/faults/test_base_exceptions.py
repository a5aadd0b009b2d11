"""Fault table, rows 1, 4, 8 and 20: code of the user that raises what ``except Exception`` does not catch."""

import asyncio

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.faulty import Hang, drive
from mbf_abstract.testing.promises import assert_ended_once, assert_next_goals_work, assert_stops
from mbf_abstract.time.clock import ThreadDetached, WallClock

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
    Actor("planner", lambda bench: GetPathGoal(Pose.planar(3.0, 0.0)), GetPathOutcome.INTERNAL_ERROR),
    Actor("controller", lambda bench: ExePathGoal(bench.path_to(9.0)), ExePathOutcome.INTERNAL_ERROR),
    Actor("recovery", lambda bench: RecoveryGoal(), RecoveryOutcome.INTERNAL_ERROR),
    Actor("refiner", lambda bench: RefinePathGoal(bench.path_to(9.0)), RefinePathOutcome.INTERNAL_ERROR),
]


@pytest.mark.parametrize("error", [*ERRORS, Unprintable()], ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("actor", ACTORS, ids=lambda actor: actor.name)
def test_whatever_a_plugin_raises_ends_its_goal_and_leaves_its_slot_alive(actor, error):
    with Bench() as bench:
        plugin = getattr(bench, actor.name)
        healthy = plugin._answers
        plugin.play(error)
        for _ in range(2):
            handle = bench.navigator.send(actor.goal(bench))
            result = handle.wait(2.0)
            assert result.outcome == actor.outcome
            assert f"plugin {actor.name!r} raised" in result.message and type(error).__name__ in result.message
            assert_ended_once(bench, handle)
        plugin.play(*healthy)
        assert bench.navigator.send(actor.goal(bench)).wait(60.0).success


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("method", ["set_plan", "is_goal_reached", "cancel"])
def test_every_method_of_a_controller_may_raise_it_while_the_robot_drives(method, error, monkeypatch):
    def boom(self, *arguments):
        raise error

    with Bench() as bench:
        monkeypatch.setattr(type(bench.controller), method, boom)
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(1.0)
        handle.cancel()
        result = handle.wait(2.0)
        ended = bench.clock.now()
        assert type(error).__name__ in result.message
        bench.clock.sleep(2.0)
        assert_stops(bench, ended)
        monkeypatch.undo()
        assert_next_goals_work(bench)


def test_a_cancel_method_that_raises_it_beside_a_hanging_call_changes_nothing(monkeypatch):
    def boom(self):
        raise SystemExit(3)

    with Bench(planner_patience=1.0, cancel_grace=0.5) as bench:
        monkeypatch.setattr(type(bench.planner), "cancel", boom, raising=False)
        hang = Hang(bench.clock)
        bench.planner.play(hang)
        assert bench.navigator.get_path(Pose.planar(3.0, 0.0)).outcome == GetPathOutcome.PAT_EXCEEDED
        assert [event.data["type"] for event in bench.events(EventKind.FAULT)] == ["SystemExit"]
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
    with Bench(robot=driver, command_timeout=0.2) as bench:
        driver.robot = bench.robot
        bench.controller.play(drive(), RuntimeError("stop"))
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(0.02)
        driver.commands_to_refuse = 3  # the zero at the end, and two of the watchdog's
        assert handle.wait(2.0).outcome == ExePathOutcome.INTERNAL_ERROR
        bench.clock.sleep(2.0)
        assert driver.commands_to_refuse == 0
        assert bench.robot.command.is_stopped()
        assert_next_goals_work(bench)


@pytest.mark.parametrize("error", ERRORS[:-1], ids=lambda error: type(error).__name__)
def test_a_driver_whose_odometry_raises_it_ends_the_goal_and_the_next_one_works(error):
    driver = Driver(error)
    with Bench(robot=driver, controller_patience=0.5) as bench:
        driver.robot = bench.robot
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(1.0)
        driver.refuses_odometry = True
        result = handle.wait(2.0)
        assert type(error).__name__ in result.message
        assert bench.robot.command.is_stopped()
        driver.refuses_odometry = False
        assert_next_goals_work(bench)


def test_on_the_wall_clock_the_slot_survives_too():
    with Bench(clock=WallClock()) as bench:
        bench.planner.play(SystemExit(3))
        assert (
            bench.navigator.send(GetPathGoal(Pose.planar(3.0, 0.0))).wait(5.0).outcome == GetPathOutcome.INTERNAL_ERROR
        )
        assert_next_goals_work(bench)


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
    with Bench() as bench:
        bench.bus.add_sink(Leaver(kind, error))
        handle = bench.navigator.send(GetPathGoal(Pose.planar(3.0, 0.0)))
        assert handle.wait(2.0).success
        assert [event.data["sink"] for event in bench.events(EventKind.SINK_FAILED)] == ["Leaver"]
        assert_ended_once(bench, handle)
        assert_next_goals_work(bench)
