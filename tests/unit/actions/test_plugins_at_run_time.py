"""Plugins are loaded, reloaded and unloaded while the server runs; refused while in use, unchanged on any mistake."""

import sys

import pytest
from pydantic import ValidationError

from mbf_abstract.config.registry import PluginError
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.faulty import slow
from mbf_abstract.testing.scripted import straight_plan

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
def bench(make_bench, source):
    bench = make_bench(planner_max_retries=0)
    bench.server.load_plugin_type(PluginKind.PLANNER, "refuser", "reloaded_planner:Refuser", code=75)
    return bench


def answer(bench):
    result = bench.navigator.get_path(TARGET, planner="refuser")
    return result.outcome, result.message


def test_a_plugin_loaded_by_its_type_serves_goals_with_its_parameters(bench):
    assert answer(bench) == (75, "one")
    assert bench.server.plugins.names(PluginKind.PLANNER) == ["planner", "refuser"]


def test_a_reloaded_plugin_runs_the_new_source_with_the_present_parameters(bench, source):
    bench.server.set_plugin_parameters(PluginKind.PLANNER, "refuser", code=80)
    source(SOURCE.replace("VERSION", "number two"))
    assert answer(bench) == (80, "one")
    bench.server.reload_plugin(PluginKind.PLANNER, "refuser")
    assert answer(bench) == (80, "number two")
    assert bench.server.plugins.names(PluginKind.PLANNER) == ["planner", "refuser"]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("this is no python", PluginError),
        (SOURCE.replace("AbstractPlanner)", "object)"), PluginError),
        (SOURCE.replace("le=99", "le=71"), ValidationError),
        (SOURCE + "\n    def __init__(self, context):\n        raise OSError('no model file')\n", ServerError),
    ],
)
def test_a_reload_that_goes_wrong_leaves_the_old_plugin_at_work(bench, source, text, error):
    source(text)
    with pytest.raises(error):
        bench.server.reload_plugin(PluginKind.PLANNER, "refuser")
    assert answer(bench) == (75, "one")


def test_a_plugin_in_use_is_not_reloaded(bench):
    plugin = bench.server.plugins.get(PluginKind.PLANNER, "refuser").instance
    plugin.make_plan = slow(bench.clock, 1.0, straight_plan)
    handle = bench.navigator.send(GetPathGoal(TARGET, planner="refuser"))
    bench.clock.sleep(0.5)
    with pytest.raises(ServerError, match="in use"):
        bench.server.reload_plugin(PluginKind.PLANNER, "refuser")
    assert handle.wait().success


def test_what_can_not_be_loaded_is_refused_with_the_reason(bench):
    load = bench.server.load_plugin_type
    with pytest.raises(ServerError, match="named 'refuser' is loaded already"):
        load(PluginKind.PLANNER, "refuser", "reloaded_planner:Refuser")
    with pytest.raises(PluginError, match="unknown type"):
        load(PluginKind.PLANNER, "new", "no_such_type")
    with pytest.raises(ValidationError, match="code"):
        load(PluginKind.PLANNER, "new", "reloaded_planner:Refuser", code=1)
    with pytest.raises(ServerError, match="no planner named 'nobody'"):
        bench.server.reload_plugin(PluginKind.PLANNER, "nobody")


def test_a_plugin_that_refuses_its_new_parameters_keeps_the_old_ones(bench, monkeypatch):
    def refuse(plugin):
        raise ValueError("this one is read once only")

    instance = bench.server.plugins.get(PluginKind.PLANNER, "refuser").instance
    monkeypatch.setattr(type(instance), "parameters_changed", refuse)
    with pytest.raises(ValueError, match="read once only"):
        bench.server.set_plugin_parameters(PluginKind.PLANNER, "refuser", code=80)
    assert answer(bench) == (75, "one")
