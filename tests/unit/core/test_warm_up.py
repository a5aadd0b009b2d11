"""Kernels are compiled before a goal: of all plugins on a real clock, of those a goal uses first in a simulation."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.plugins import Plugin
from mbf_abstract.testing.faulty import BusyHang, Hang
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock

HERE, THERE = Pose.planar(0.0, 0.0), Pose.planar(3.0, 0.0)
PLUGINS = {"a": ScriptedPlanner, "b": ScriptedPlanner, "c": ScriptedController, "d": ScriptedController}
ALL = ["planner a (1 of 4)", "planner b (2 of 4)", "controller c (3 of 4)", "controller d (4 of 4)"]


@pytest.mark.parametrize(
    ("only_defaults", "expected"), [(False, ALL), (True, ["planner a (1 of 2)", "controller c (2 of 2)"])]
)
def test_all_plugins_are_warmed_up_or_those_that_a_goal_without_names_uses(only_defaults, expected):
    steps = []
    with ScriptedSession(plugins=PLUGINS) as session:
        session.server.warm_up(HERE, THERE, steps.append, only_defaults)
    assert steps == [f"warming up {step}" for step in expected]


@pytest.mark.parametrize("make_clock", [SimClock, WallClock])
@pytest.mark.parametrize(
    ("plugin", "answer", "message"),
    [
        ("planner", ValueError("no idea"), "plugin 'planner' raised ValueError in make_plan: no idea"),
        ("planner", SystemExit(3), "plugin 'planner' raised SystemExit in make_plan: 3"),
        ("planner", None, "plugin 'planner' returned NoneType from make_plan, not PlanResult"),
        ("controller", ValueError("no"), "plugin 'controller' raised ValueError in compute_velocity_commands: no"),
    ],
)
def test_a_plugin_that_misbehaves_is_passed_over_and_its_goal_says_why(make_clock, plugin, answer, message):
    with ScriptedSession(clock=make_clock(), planner_max_retries=0, controller_max_retries=0) as session:
        session.plugin(plugin, Plugin).play(answer)
        session.server.warm_up(HERE, THERE)
        assert session.recorded(EventKind.FAULT)[0].data["where"] == "warm_up"
        assert message in session.navigator.send(MoveBaseGoal(THERE)).wait().message


@pytest.mark.parametrize("make_clock", [SimClock, WallClock])
def test_a_plugin_that_hangs_is_quarantined_and_the_next_ones_have_their_turn(make_clock):
    with ScriptedSession(PLUGINS, make_clock(), hang_guard=0.2) as session:
        hang = Hang(session.clock)
        session.plugin("a", ScriptedPlanner).play(hang)
        session.server.warm_up(HERE, THERE)
        assert len(session.plugin("d", ScriptedController).paths) == 1
        assert "quarantined: its first call took more than 0.2 s" in session.navigator.get_path(THERE).message
        hang.release()


def test_a_plugin_that_keeps_the_processor_busy_is_quarantined_while_simulated_time_stands():
    with ScriptedSession(hang_guard=0.2) as session:
        hang = BusyHang()
        session.planner.play(hang)
        session.server.warm_up(HERE, THERE)
        assert "quarantined: its first call took more than 0.2 s" in session.navigator.get_path(THERE).message
        hang.release.cancel()
