"""Plugins are loaded, reloaded and unloaded while the server runs; refused while in use, unchanged on any mistake."""

import sys

import pytest
from pydantic import field_validator

from mbf_abstract.config.configuration import PluginSpec
from mbf_abstract.config.registry import PluginError
from mbf_abstract.execution.loaded_plugin import PluginGone
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal, RecoveryGoal
from mbf_abstract.outcomes import GetPathOutcome as Outcome
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import ParameterError, PluginParameters
from mbf_abstract.plugins import AbstractRecovery, PluginKind, RecoveryResult
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.faulty import slow
from mbf_abstract.testing.scripted import ScriptedPlanner, straight_plan

TARGET = Pose.planar(1.0, 0.0)
SOURCE = """
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import AbstractPlanner, PlanResult


class Parameters(PluginParameters):
    code: int = parameter(70, "The answer.", ge=50, le=99)


class Refuser(AbstractPlanner):
    Parameters = Parameters

    def make_plan(self, request):
        return PlanResult(self.parameters.code, "VERSION")
"""


@pytest.fixture
def source(tmp_path, monkeypatch):
    """Write versions of a plugin's module."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def write(text):
        (tmp_path / "reloaded_planner.py").write_text(text)

    write(SOURCE.replace("VERSION", "one"))
    yield write
    sys.modules.pop("reloaded_planner", None)


@pytest.fixture
def session(make_session, source):
    session = make_session(planner_max_retries=0)
    session.server.load_plugin_type(PluginKind.PLANNER, "refuser", "reloaded_planner:Refuser", code=75)
    return session


def answer(session):
    result = session.navigator.get_path(TARGET, planner="refuser")
    return result.outcome, result.message


def test_a_plugin_loaded_by_its_type_serves_goals_with_its_parameters(session):
    assert answer(session) == (75, "one")
    assert session.server.plugins.names(PluginKind.PLANNER) == ["planner", "refuser"]


def test_each_plugin_draws_numbers_of_its_own_and_the_same_ones_in_every_session(make_session):
    def drawn(session, name):
        session.server.load_plugin_type(PluginKind.PLANNER, name, "mbf_abstract.testing.scripted:ScriptedPlanner")
        return session.plugin(name, ScriptedPlanner).rng.random()

    first, again = make_session(), make_session()
    assert drawn(first, "one") == drawn(again, "one") != drawn(first, "other")


@pytest.mark.parametrize(("min_vel_x", "may_reverse"), [(-0.1, True), (0.0, False)])
def test_a_plugin_knows_whether_its_robot_may_drive_backward(make_session, min_vel_x, may_reverse):
    assert make_session(min_vel_x=min_vel_x).planner.may_reverse is may_reverse


def test_a_reloaded_plugin_runs_the_new_source_with_the_present_parameters(session, source):
    session.server.set_plugin_parameters(PluginKind.PLANNER, "refuser", code=80)
    source(SOURCE.replace("VERSION", "number two"))
    assert answer(session) == (80, "one")
    session.server.reload_plugin(PluginKind.PLANNER, "refuser")
    assert answer(session) == (80, "number two")
    assert session.server.plugins.names(PluginKind.PLANNER) == ["planner", "refuser"]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("this is no python", PluginError),
        (SOURCE.replace("AbstractPlanner)", "object)"), PluginError),
        (SOURCE.replace("le=99", "le=71"), ParameterError),
        (SOURCE + "\n    def __init__(self, context):\n        raise OSError('no model file')\n", ServerError),
    ],
)
def test_a_reload_that_goes_wrong_leaves_the_old_plugin_at_work(session, source, text, error):
    source(text)
    with pytest.raises(error):
        session.server.reload_plugin(PluginKind.PLANNER, "refuser")
    assert answer(session) == (75, "one")


def test_a_plugin_in_use_is_not_reloaded(session):
    plugin = session.server.plugins.get(PluginKind.PLANNER, "refuser").instance
    plugin.make_plan = slow(session.clock, 1.0, straight_plan)
    handle = session.navigator.send(GetPathGoal(TARGET, planner="refuser"))
    session.clock.sleep(0.5)
    with pytest.raises(ServerError, match="in use"):
        session.server.reload_plugin(PluginKind.PLANNER, "refuser")
    assert handle.wait().success


def test_what_can_not_be_loaded_is_refused_with_the_reason(session):
    load = session.server.load_plugin_type
    with pytest.raises(ServerError, match="named 'refuser' is loaded already"):
        load(PluginKind.PLANNER, "refuser", "reloaded_planner:Refuser")
    with pytest.raises(PluginError, match="unknown type"):
        load(PluginKind.PLANNER, "new", "no_such_type")
    with pytest.raises(ParameterError, match=r"^new\.code: expected .*, got "):
        load(PluginKind.PLANNER, "new", "reloaded_planner:Refuser", code=1)
    with pytest.raises(ServerError, match="no planner named 'nobody'"):
        session.server.reload_plugin(PluginKind.PLANNER, "nobody")


def test_a_plugin_that_refuses_its_new_parameters_keeps_the_old_ones(session, monkeypatch):
    def refuse(plugin):
        raise ValueError("this one is read once only")

    instance = session.server.plugins.get(PluginKind.PLANNER, "refuser").instance
    monkeypatch.setattr(type(instance), "parameters_changed", refuse)
    with pytest.raises(ValueError, match="read once only"):
        session.server.set_plugin_parameters(PluginKind.PLANNER, "refuser", code=80)
    assert answer(session) == (75, "one")


@pytest.fixture
def resting(make_session):
    """A session whose recovery ``rest`` takes a second to look at a value of ``effort`` other than its default."""
    session = make_session()

    class Parameters(PluginParameters):
        duration: float = 3.0
        effort: int = 0

        @field_validator("effort")
        @classmethod
        def look(cls, value):
            session.clock.sleep(1.0 if value else 0.0)
            return value

    class Rest(AbstractRecovery):
        def run_behavior(self, request):
            request.motion.sleep(self.parameters.duration)
            return RecoveryResult(RecoveryOutcome.SUCCESS, "rested")

    Rest.Parameters = Parameters
    session.server.load_plugin(PluginSpec(PluginKind.RECOVERY, "rest", "rest", Rest, Parameters(), {}))
    return session


def test_parameters_of_a_goal_that_ends_during_a_change_do_not_stay(resting):
    rest = resting.server.plugins.get(PluginKind.RECOVERY, "rest").instance
    handle = resting.navigator.send(RecoveryGoal("rest", parameters={"duration": 0.5}))
    resting.clock.sleep(0.1)
    with pytest.raises(ServerError, match="recovery 'rest' is in use"):
        resting.server.set_plugin_parameters(PluginKind.RECOVERY, "rest", effort=1)
    assert handle.wait().success
    resting.clock.sleep(0.1)
    assert rest.parameters.duration == 3.0
    resting.server.set_plugin_parameters(PluginKind.RECOVERY, "rest", effort=1)
    assert (rest.parameters.duration, rest.parameters.effort) == (3.0, 1)


def test_parameters_of_a_goal_that_ends_during_a_reload_do_not_stay(resting, monkeypatch):
    registry = type(resting.server.plugin_registry())
    loaded = resting.server.plugins.get(PluginKind.RECOVERY, "rest")
    monkeypatch.setattr(registry, "reload", lambda registry, kind, type_name: loaded.spec.plugin_class)
    construct = resting.server._construct
    monkeypatch.setattr(resting.server, "_construct", lambda spec: resting.clock.sleep(1.0) or construct(spec))
    handle = resting.navigator.send(RecoveryGoal("rest", parameters={"duration": 0.5}))
    resting.clock.sleep(0.1)
    with pytest.raises(ServerError, match="recovery 'rest' is in use"):
        resting.server.reload_plugin(PluginKind.RECOVERY, "rest")
    assert handle.wait().success


def test_a_plugin_in_use_is_not_unloaded(make_session):
    session = make_session()
    session.plugin("planner", ScriptedPlanner).play(slow(session.clock, 1.0, straight_plan))
    handle = session.navigator.send(GetPathGoal(TARGET))
    session.clock.sleep(0.1)
    with pytest.raises(ServerError, match="in use"):
        session.server.unload_plugin(PluginKind.PLANNER, "planner")
    with pytest.raises(ServerError, match="in use"):
        session.server.set_plugin_parameters(PluginKind.PLANNER, "planner")
    assert handle.wait().success
    session.clock.sleep(0.1)
    session.server.unload_plugin(PluginKind.PLANNER, "planner")
    assert session.navigator.send(GetPathGoal(TARGET)).result.outcome == Outcome.INVALID_PLUGIN
    with pytest.raises(ServerError, match="no planner named 'planner'"):
        session.server.unload_plugin(PluginKind.PLANNER, "planner")


def test_a_plugin_unloaded_between_acceptance_and_start_ends_the_goal_with_its_name(make_session):
    session = make_session()
    handle = session.navigator.send(GetPathGoal(TARGET, planner="planner"))
    session.server.unload_plugin(PluginKind.PLANNER, "planner")
    result = handle.wait()
    assert result.outcome == Outcome.INVALID_PLUGIN
    assert "'planner'" in result.message
    with pytest.raises(PluginGone):
        session.server.plugins.get(PluginKind.PLANNER, "planner")
