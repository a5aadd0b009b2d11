import math
from pathlib import Path
from typing import Literal

import pytest

from mbf_abstract.config.configuration import NavigationParameters, PluginDeclaration
from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.reading import load_config, validate_config
from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.parameters import ParameterModel, PluginParameters, parameter
from mbf_abstract.plugins import AbstractPlanner, AbstractRecovery, PlanResult, PluginKind, RecoveryResult


class CVPParameters(PluginParameters):
    cost_limit: float = parameter(1.0, "Cost limit.", ge=0.0, le=1.0)


class CVP(AbstractPlanner):
    Parameters = CVPParameters

    def make_plan(self, request):
        return PlanResult(0)


class Wait(AbstractRecovery):
    def run_behavior(self, request):
        return RecoveryResult(0)


class SteepnessParameters(ParameterModel):
    threshold: float = parameter(0.3, "Threshold.", unit="rad", ge=0.0)


class Steepness:
    Parameters = SteepnessParameters


class LayerEntry(ParameterModel):
    name: str
    type: str


class MeshMapParameters(ParameterModel):
    mesh_file: Path
    layers: tuple[LayerEntry, ...] = ()


class CostmapDeclaration(PluginDeclaration):
    costmap: Literal["local", "global"] | None = None


@pytest.fixture(autouse=True)
def nothing_installed(monkeypatch):
    """Hide the entry points of the installed packages."""
    monkeypatch.setattr("mbf_abstract.config.installed_plugins.installed_points", lambda group: [])


def registry(**options):
    registry = PluginRegistry("mesh", **options)
    registry.register(PluginKind.PLANNER, "mesh.cvp", CVP)
    registry.register(PluginKind.RECOVERY, "wait", Wait)
    registry.register("mesh_layers", "mesh.steepness", Steepness)
    registry.register("mesh_layers", "mesh.plain", dict)
    return registry


def check(folder, text, sections=None, declaration=PluginDeclaration, **options):
    path = folder / "c.yaml"
    path.write_text(text)
    raw = load_config(path)
    sections = {"mesh_map": MeshMapParameters} if sections is None else sections
    return validate_config(raw, sections, registry(allow_module_types=raw.allow_module_types, **options), declaration)


def refused(folder, text, **options):
    with pytest.raises(ConfigError) as error:
        check(folder, text, **options)
    return [finding.text.removeprefix(f"{folder / 'c.yaml'}:") for finding in error.value.findings]


GOOD = """\
backend: mesh
controller_frequency: 10
planners:
  - {name: first, type: cvp}
  - {name: second, type: mesh.cvp}
recovery_behaviors:
  - {name: pause, type: wait}
second: {cost_limit: 0.5}
mesh_map:
  mesh_file: hill.ply
  layers:
    - {name: steep, type: steepness}
    - {name: other, type: steepness}
  steep: {threshold: 0.5}
"""


def test_a_good_configuration_becomes_classes_and_models(tmp_path):
    config = check(tmp_path, GOOD)
    assert config.backend == "mesh"
    assert config.parameters.controller_frequency == 10.0
    assert [(spec.kind, spec.name, spec.plugin_class) for spec in config.plugins] == [
        (PluginKind.PLANNER, "first", CVP),
        (PluginKind.PLANNER, "second", CVP),
        (PluginKind.RECOVERY, "pause", Wait),
    ]
    assert [spec.parameters.cost_limit for spec in config.plugins if spec.kind is PluginKind.PLANNER] == [1.0, 0.5]
    assert config.plugins[1].line == 5
    section = config.sections["mesh_map"]
    assert section.parameters.mesh_file == tmp_path / "hill.ply"
    assert [(layer.name, layer.layer_class, layer.parameters.threshold) for layer in section.layers] == [
        ("steep", Steepness, 0.5),
        ("other", Steepness, 0.3),
    ]


def test_everything_wrong_is_found_at_once(tmp_path):
    text = """\
backend: mesh
controller_frequency: -1
controller_freqency: 20
planner_patience: soon
planners:
  - {name: cvp, type: cvp}
  - {name: cvp, type: cvp}
  - {name: nothing}
  - {name: odd, type: cpv}
  - {name: wait, type: wait, colour: red}
controllers: cvp
cvp: {cost_limit: 2, cost_limits: 1}
cvp2: {}
mesh_map:
  layers:
    - {name: steep, type: steepnes}
    - {name: flat, type: steepness}
    - {name: flat, type: steepness}
    - {name: mesh_file, type: steepness}
    - {name: plain, type: plain}
    - {name: typeless}
  flat: {threshold: -1}
allow_module_types: 3
planners: []
"""
    assert refused(tmp_path, text) == [
        "2: controller_frequency: expected a number > 0 and <= 100 Hz, got -1",
        "3: controller_freqency: expected a known key, a section of this backend or a plugin's name, "
        "got 'controller_freqency' (did you mean 'controller_frequency'?)",
        "4: planner_patience: expected a number >= 0 and <= 100 s, got 'soon'",
        "7: planners[1].name: expected a name no other plugin has, got 'cvp' (first in line 6)",
        "8: planners[2].type: expected a value, got nothing",
        "9: planners[3].type: expected a type of planners that loads, got 'cpv' "
        "(unknown type; did you mean 'cvp'? known types: cvp)",
        "10: planners[4].colour: expected a known key, got 'colour' (known keys: name, type, optional)",
        "11: controllers: expected a list of {name, type}, got 'cvp'",
        "12: cvp.cost_limit: expected a number >= 0 and <= 1, got 2",
        "12: cvp.cost_limits: expected a known key, got 'cost_limits' (did you mean 'cost_limit'?)",
        "13: cvp2: expected a known key, a section of this backend or a plugin's name, "
        "got 'cvp2' (did you mean 'cvp'?)",
        "14: mesh_map.mesh_file: expected a value, got nothing",
        "16: mesh_map.layers[0].type: expected a type of mesh_layers that loads, got 'steepnes' "
        "(unknown type; did you mean 'steepness'? known types: plain, steepness)",
        "18: mesh_map.layers[2].name: expected a name of its own, got 'flat' (first in line 17)",
        "19: mesh_map.layers[3].name: expected a name of its own, got 'mesh_file' (a key of the section)",
        "20: mesh_map.layers[4].type: expected a class with Parameters, got 'plain'",
        "21: mesh_map.layers[5].type: expected a value, got nothing",
        "22: mesh_map.flat.threshold: expected a number >= 0 rad, got -1",
        "23: allow_module_types: expected true or false, got 3",
        "24: planners: expected each key once, got 'planners' a second time (first in line 5)",
    ]


@pytest.mark.parametrize("value", ["", "3", "[costmap]"])
def test_a_configuration_without_a_backend_is_refused(tmp_path, value):
    assert "backend: expected costmap, mesh or module:Class" in refused(tmp_path, f"a: 1\nbackend: {value}\n")[0]


def test_findings_of_the_reader_come_with_the_others(tmp_path):
    assert len(refused(tmp_path, "backend: mesh\nx: 1\nx: 2\n", sections={})) == 2


@pytest.mark.parametrize("name", ["planners", "planner_patience", "mesh_map", ""])
def test_a_plugin_cannot_have_the_name_of_a_key(tmp_path, name):
    text = f"backend: mesh\nplanners: [{{name: '{name}', type: cvp}}]\nmesh_map: {{mesh_file: x}}\n"
    assert any("expected a name that is no key of the configuration" in line for line in refused(tmp_path, text))


def test_two_kinds_cannot_share_a_name(tmp_path):
    text = GOOD.replace("name: pause", "name: first")
    assert refused(tmp_path, text) == [
        "7: recovery_behaviors[0].name: expected a name no other plugin has, got 'first' (first in line 4)"
    ]


def test_an_optional_plugin_that_does_not_load_is_skipped_with_its_reason(tmp_path):
    config = check(tmp_path, GOOD.replace("type: mesh.cvp", "type: 'no_such_module:Planner', optional: true"))
    assert [spec.name for spec in config.plugins] == ["first", "pause"]
    assert config.skipped[0].name == "second"
    assert "No module named 'no_such_module'" in config.skipped[0].reason


def test_wrong_parameters_of_an_optional_plugin_are_still_refused(tmp_path):
    text = GOOD.replace("type: mesh.cvp", "type: mesh.cvp, optional: true").replace("0.5}\nmesh", "7}\nmesh")
    assert refused(tmp_path, text) == ["8: second.cost_limit: expected a number >= 0 and <= 1, got 7"]


def test_module_types_can_be_switched_off_in_the_file(tmp_path):
    text = GOOD.replace("type: mesh.cvp", "type: 'os:getcwd'")
    assert "os:getcwd" in refused(tmp_path, text)[0]
    assert "switched off (allow_module_types)" in refused(tmp_path, text + "allow_module_types: false\n")[0]


def test_a_server_can_add_keys_to_the_plugin_lists(tmp_path):
    text = GOOD.replace("type: mesh.cvp", "type: mesh.cvp, costmap: local")
    config = check(tmp_path, text, declaration=CostmapDeclaration)
    assert [dict(spec.options) for spec in config.plugins] == [
        {"costmap": None},
        {"costmap": "local"},
        {"costmap": None},
    ]
    assert "expected a known key, got 'costmap'" in refused(tmp_path, text)[0]


def test_a_section_without_layers_and_an_absent_section_are_checked_alike(tmp_path):
    class Plain(ParameterModel):
        size: float = parameter(1.0, "Size.", gt=0.0)

    assert check(tmp_path, "backend: mesh\n", {"plain": Plain}).sections["plain"].parameters.size == 1.0
    assert refused(tmp_path, "backend: mesh\nplain: {size: 0}\n", sections={"plain": Plain}) == [
        "2: plain.size: expected a number > 0, got 0"
    ]
    assert refused(tmp_path, "backend: mesh\n") == ["1: mesh_map.mesh_file: expected a value, got nothing"]


# name, default, dynamic: the table of MBF's parameters
MBF_PARAMETERS = [
    ("planner_frequency", 0.0, True),
    ("planner_patience", 5.0, True),
    ("planner_max_retries", -1, True),
    ("controller_frequency", 20.0, True),
    ("controller_patience", 5.0, True),
    ("controller_max_retries", -1, True),
    ("recovery_enabled", True, True),
    ("recovery_patience", 15.0, True),
    ("oscillation_timeout", 0.0, True),
    ("oscillation_distance", 0.5, True),
    ("oscillation_angle", 3.14, True),
    ("restore_defaults", False, True),
    ("shutdown_costmaps", False, True),
    ("shutdown_costmaps_delay", 1.0, True),
    ("clear_on_shutdown", False, False),
    ("force_stop_at_goal", True, False),  # upstream: False, which lets the robot roll on
    ("force_stop_on_cancel", True, False),  # upstream: False
    ("force_stop_on_retry", True, False),
    ("mbf_tolerance_check", False, False),
    ("dist_tolerance", 0.1, False),
    ("angle_tolerance", math.pi / 18, False),
    ("cmd_vel_ignored_tolerance", 5.0, False),
    ("tf_timeout", 3.0, False),
    ("global_frame", "map", False),
    ("robot_frame", "base_link", False),
    ("tf_cache_time", 10.0, False),
]


@pytest.mark.parametrize(("name", "default", "dynamic"), MBF_PARAMETERS)
def test_mbf_parameters_have_their_default_and_mark(name, default, dynamic):
    field = NavigationParameters.model_fields[name]
    assert getattr(NavigationParameters(), name) == default
    assert field.json_schema_extra["dynamic"] is dynamic
    assert field.description.endswith(".")


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("planner_frequency", -0.1, 100.1),
        ("planner_patience", -0.1, 100.1),
        ("planner_max_retries", -2, 1001),
        ("controller_frequency", 0, 100.1),
        ("controller_max_retries", -2, 1001),
        ("oscillation_timeout", -0.1, 60.1),
        ("oscillation_distance", -0.1, 10.1),
        ("oscillation_angle", -0.1, 6.29),
        ("shutdown_costmaps_delay", -0.1, 60.1),
    ],
)
def test_values_out_of_mbfs_range_are_refused(name, low, high):
    for value in (low, high):
        with pytest.raises(ValueError, match=name):
            NavigationParameters(**{name: value})


def test_a_watchdog_shorter_than_a_control_period_is_refused():
    with pytest.raises(ValueError, match="at least one control period"):
        NavigationParameters(command_timeout=0.5, controller_frequency=1.0)


def test_a_behaviour_for_a_stuck_robot_must_be_one_of_the_recovery_behaviours(tmp_path):
    text = GOOD.replace("second: {", "escalation_behaviors: [pause, pase, first]\nsecond: {")
    assert refused(tmp_path, text) == [
        "8: escalation_behaviors[1]: expected the name of one of the recovery_behaviors, got 'pase' "
        "(did you mean 'pause'?)",
        "8: escalation_behaviors[2]: expected the name of one of the recovery_behaviors, got 'first'",
    ]


def test_behaviours_for_a_stuck_robot_are_taken_over_in_their_order(tmp_path):
    text = GOOD.replace("second: {", "escalation_behaviors: [pause]\nsecond: {")
    assert check(tmp_path, text).parameters.escalation_behaviors == ("pause",)


def test_a_behaviour_for_the_right_of_way_that_the_file_does_not_list_is_refused_with_its_line(tmp_path):
    text = GOOD.replace("second: {", "right_of_way_behavior: pase\nsecond: {")
    (finding,) = refused(tmp_path, text)
    assert finding.startswith("8: right_of_way_behavior: expected the name of one of the recovery_behaviors")


def test_a_fallback_planner_that_the_file_does_not_list_is_refused_with_its_line(tmp_path):
    text = GOOD.replace("second: {", "fallback_planner: secnd\nsecond: {")
    (finding,) = refused(tmp_path, text)
    assert finding.startswith("8: fallback_planner: expected the name of one of the planners, got 'secnd'")


def test_a_list_of_planners_that_is_none_and_a_name_out_of_it_are_one_mistake_each(tmp_path):
    text = "backend: mesh\nplanners: 1.0\nfallback_planner: first\nmesh_map: {mesh_file: hill.ply}\n"
    assert refused(tmp_path, text) == [
        "2: planners: expected a list of {name, type}, got 1.0",
        "3: fallback_planner: expected the name of one of the planners, got 'first'",
    ]


def test_a_refiner_of_plans_that_the_file_does_not_list_is_refused_with_its_line(tmp_path):
    text = GOOD.replace("second: {", "plan_refiner: smooth\nsecond: {")
    assert refused(tmp_path, text) == ["8: plan_refiner: expected the name of one of the refiners, got 'smooth'"]
