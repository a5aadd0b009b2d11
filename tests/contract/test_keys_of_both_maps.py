"""What means the same has one key on both maps, and an earlier key is refused with the one it has now."""

import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.conformance.site import site

MESH = """\
backend: mesh
planners: [{name: cvp, type: cvp}]
controllers: [{name: follower, type: CONTROLLER}]
recovery_behaviors: []
mesh_map: {mesh_file: floor.ply, layers: [{name: seen, type: LAYER}]}
"""
COSTMAP = """\
backend: costmap
planners: [{name: astar, type: astar}]
controllers: [{name: follower, type: CONTROLLER}]
global_costmap: {width: 4.0, height: 4.0, layers: [{name: seen, type: LAYER}]}
local_costmap: {width: 4.0, height: 4.0, layers: []}
"""


@pytest.mark.parametrize(
    ("text", "plugin", "old", "new"),
    [
        (COSTMAP, "dwa", "footprint_check_time", "check_ahead_time"),
        (COSTMAP, "mppi", "footprint_check_time", "check_ahead_time"),
        (COSTMAP, "regulated_pure_pursuit", "collision_check_time", "check_ahead_time"),
        (MESH, "path_follower", "obstacle_distance", "check_ahead_dist"),
        (MESH, "vector_field", "obstacle_distance", "check_ahead_dist"),
    ],
)
def test_how_far_ahead_a_controller_looks_has_one_name(tmp_path, text, plugin, old, new):
    text = text.replace("CONTROLLER", plugin)
    findings = _findings(tmp_path, f"{text}follower: {{{old}: 1.0}}\n")
    assert f"follower.{old}: expected a known key, got '{old}'" in findings
    assert f"it is called '{new}' now" in findings
    assert "follower" not in _findings(tmp_path, f"{text}follower: {{{new}: 1.0}}\n")


@pytest.mark.parametrize("layer", ["obstacle", "moving_obstacles"])
@pytest.mark.parametrize(
    ("old", "new"), [("max_obstacle_dist", "obstacle_max_range"), ("min_obstacle_dist", "obstacle_min_range")]
)
def test_how_far_points_count_has_one_name(tmp_path, layer, old, new):
    text = MESH.replace("CONTROLLER", "path_follower").replace("LAYER", layer)
    findings = _findings(tmp_path, text.replace("]}", f"], seen: {{sources: [lidar], {old}: 1.0}}}}"))
    assert f"mesh_map.seen.{old}: expected a known key, got '{old}'" in findings
    assert f"it is called '{new}' now" in findings
    assert "seen" not in _findings(tmp_path, text.replace("]}", f"], seen: {{sources: [lidar], {new}: 1.0}}}}"))


@pytest.mark.parametrize(
    ("backend", "controller", "old", "new"),
    [
        ("costmap", "regulated_pure_pursuit", "collision_check_time", "check_ahead_time"),
        ("mesh", "path_follower", "obstacle_distance", "check_ahead_dist"),
    ],
)
def test_an_earlier_key_is_refused_with_its_new_name_at_run_time_too(backends, backend, controller, old, new):
    with site(backends[backend]) as made:
        change, name = made.server.set_plugin_parameters, made.server.plugins.names(PluginKind.CONTROLLER)[0]
        with pytest.raises(ValueError, match=rf"{old}: expected a known key, got '{old}' \(it is called '{new}' now\)"):
            change(PluginKind.CONTROLLER, name, **{old: 1.0})
        with pytest.raises(ValueError, match="did you mean 'max_vel_x'"):
            change(PluginKind.CONTROLLER, name, max_vel=1.0)
        with pytest.raises(ValueError, match="did you mean 'controller_frequency'"):
            made.server.set_parameters(controller_freq=1.0)
        change(PluginKind.CONTROLLER, name, **{new: 1.0})


def _findings(folder, text):
    """All findings of a configuration's text; empty if there are none."""
    file = folder / "navigation.yaml"
    file.write_text(text)
    try:
        read_config(file)
    except ConfigError as error:
        return str(error)
    return ""
