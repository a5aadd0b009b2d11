"""A plugin for another map than the server's is refused by the check and when it is loaded, by one error."""

import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.registry import PluginError
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.conformance.site import site

BACKENDS = {
    "costmap": "backend: costmap\nglobal_costmap: {width: 5, height: 5}\nlocal_costmap: {width: 5, height: 5}\n",
    "mesh": "backend: mesh\nmesh_map: {mesh_file: none.ply}\n",
    "tiles": "backend: tiles\ntiled_map: {folder: none}\n",
    "elevation_grid": "backend: elevation_grid:ElevationGridServer\nelevation_grid: {file: none.npz}\n",
}
OF_COSTMAPS = [
    ("planners", "mbf_costmap_nav.planners.astar:AStarPlanner"),
    ("planners", "costmap.astar"),
    ("controllers", "mbf_costmap_nav.controllers.dwa:DWAController"),
    ("recovery_behaviors", "mbf_costmap_nav.recoveries.escape:EscapeRecovery"),
    ("refiners", "mbf_costmap_nav.refiners.smoother:SmootherRefiner"),
]
OF_MESHES = [
    ("planners", "mbf_mesh_nav.planners.astar:AStarPlanner"),
    ("planners", "mesh.astar"),
    ("controllers", "mbf_mesh_nav.controllers.path_follower:PathFollower"),
    ("recovery_behaviors", "mbf_mesh_nav.recoveries.escape:EscapeRecovery"),
]
OF_TILES = [("planners", "mbf_mesh_nav.planners.hierarchical:HierarchicalPlanner")]
OF_GRAPHS = [("planners", "mbf_abstract.maps.graph.graph_planner:GraphPlanner")]
FOREIGN = [
    *(("costmap", *plugin, "LayeredCostmap") for plugin in [*OF_MESHES, *OF_TILES, *OF_GRAPHS]),
    *(("mesh", *plugin, "MeshMap") for plugin in [*OF_COSTMAPS, *OF_TILES, *OF_GRAPHS]),
    *(("tiles", *plugin, "TiledNavigationMap") for plugin in [*OF_COSTMAPS, *OF_GRAPHS]),
    *(("elevation_grid", *plugin, "GraphMap") for plugin in [*OF_COSTMAPS, *OF_MESHES]),
]


@pytest.fixture
def findings(tmp_path):
    """``findings(backend, list, type)`` -> what is wrong with a configuration that names one plugin."""

    def read(backend, of_list, type_name):
        file = tmp_path / "navigation.yaml"
        file.write_text(f"{BACKENDS[backend]}{of_list}:\n  - {{name: mine, type: '{type_name}'}}\n")
        with pytest.raises(ConfigError) as caught:
            read_config(file)
        return [one for one in caught.value.findings if of_list in one.key]

    return read


@pytest.mark.parametrize(("backend", "of_list", "type_name", "map_name"), FOREIGN)
def test_a_configuration_with_a_plugin_of_another_map_is_refused_with_its_line(
    findings, backend, of_list, type_name, map_name
):
    (finding,) = findings(backend, of_list, type_name)
    assert finding.line == 5 if backend == "costmap" else 4
    assert finding.key == f"{of_list}[0].type"
    assert " needs a " in finding.hint and f"the map of the server is a {map_name}" in finding.hint


@pytest.mark.parametrize(("backend", "type_name"), [("costmap", "mesh.astar"), ("mesh", "costmap.astar")])
def test_loading_one_at_run_time_is_refused_and_the_server_goes_on(backends, backend, type_name):
    with site(backends[backend]) as made:
        with pytest.raises(PluginError, match=r"AStarPlanner needs a .*, the map of the server is a"):
            made.server.load_plugin_type(PluginKind.PLANNER, "foreign", type_name)
        assert made.server.plugins.find(PluginKind.PLANNER, "foreign") is None
