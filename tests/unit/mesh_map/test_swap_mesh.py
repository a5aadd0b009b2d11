"""Another mesh at run time: the robot came out of the lift on another floor."""

import h5py
import numpy as np
import pytest
import trimesh

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_mesh_nav.files.lvr2_io import LAYOUTS
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.repair import MeshError

CONFIG = """
backend: mesh
planner_max_retries: 0
planners: [{name: astar, type: astar}, {name: cvp, type: cvp}]
controllers: [{name: follow, type: path_follower}]
mesh_map:
  mesh_file: small.ply
  inscribed_radius: 0.3
  layers: [{name: slopes, type: steepness}]
  slopes: {threshold: 0.5}
"""
FAR = Pose.planar(6.5, 0.5)


@pytest.fixture
def navigator(tmp_path):
    """A robot on a floor of 4 x 4 m; the next floor has 8 x 4 m."""
    for name, columns in (("small", 21), ("large", 41)):
        mesh = trimesh.Trimesh(*heightfield_mesh(np.zeros((21, columns)), 0.2, 0.2), process=False)
        mesh.export(tmp_path / f"{name}.ply")
    (tmp_path / "broken.ply").write_text("no mesh")
    (tmp_path / "mesh.yaml").write_text(CONFIG)
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(0.45, 0.45))
    events = EventBus(clock.now, [MemorySink()])
    with Navigator.from_file(tmp_path / "mesh.yaml", robot, clock, transforms, events) as made:
        clock.sleep(0.1)
        yield made
    robot.close()


def reported(navigator) -> list[tuple[str, int, bool]]:
    """What the events say of the meshes loaded so far."""
    events = navigator.server.runtime.events.memory.of_kind(EventKind.MAP)
    return [(event.data["finding"], event.data["count"], event.data["repaired"]) for event in events]


def test_every_finding_in_a_mesh_is_an_event_when_it_is_loaded_and_when_it_is_swapped(navigator, tmp_path):
    assert reported(navigator) == [("coarse", 441, False), ("narrow", 0, False)]
    vertices, faces = heightfield_mesh(np.zeros((21, 21)), 0.2, 0.2)
    far = np.vstack([vertices, vertices + np.array([10.0, 0.0, 0.0])])
    turned = np.vstack([faces, faces[:, ::-1] + len(vertices)])
    trimesh.Trimesh(far, turned, process=False).export(tmp_path / "two.ply")
    with pytest.raises(MeshError):
        navigator.server.swap_mesh("broken.ply")
    assert len(reported(navigator)) == 2

    navigator.server.swap_mesh("two.ply")

    defects = [("facing_down", 800, False), ("components", 2, False)]
    assert reported(navigator)[2:] == [*defects, ("coarse", 882, False), ("narrow", 0, False)]
    messages = [event.data["message"] for event in navigator.server.runtime.events.memory.of_kind(EventKind.MAP)]
    assert messages[3].startswith("components: 2 components, the largest with 441 of 882 vertices (indices 0, 441)")


def test_the_notes_are_those_of_the_mesh_that_is_served(navigator, tmp_path):
    first = navigator.server.notes
    vertices, faces = heightfield_mesh(np.zeros((21, 21)), 0.2, 0.2)
    far = np.vstack([vertices, vertices + np.array([10.0, 0.0, 0.0])])
    trimesh.Trimesh(far, np.vstack([faces, faces + len(vertices)]), process=False).export(tmp_path / "two.ply")
    navigator.server.swap_mesh("two.ply")
    assert next(note for note in navigator.server.notes if note not in first).startswith("components: 2 components")
    assert len(navigator.server.notes) == len(first) + 1
    navigator.server.swap_mesh("small.ply")
    assert navigator.server.notes == first


@pytest.mark.parametrize("planner", ["astar", "cvp"])
def test_goals_that_only_the_new_mesh_has_are_reached_after_the_swap(navigator, planner):
    assert navigator.get_path(FAR, planner=planner).outcome == GetPathOutcome.OUT_OF_MAP
    navigator.server.swap_mesh("large.ply")
    assert navigator.get_path(FAR, planner=planner).success
    assert set(navigator.server.mesh_map.layers) == {"slopes"}


def test_plugins_keep_the_parameters_they_were_given_at_run_time(navigator):
    navigator.server.set_plugin_parameters(PluginKind.PLANNER, "astar", cost_limit=0.7)
    navigator.server.swap_mesh("large.ply")
    assert navigator.server.plugins.get(PluginKind.PLANNER, "astar").instance.parameters.cost_limit == 0.7


def test_a_mesh_that_cannot_be_read_leaves_everything_as_it_was(navigator):
    before = navigator.server.mesh_map
    with pytest.raises(MeshError):
        navigator.server.swap_mesh("broken.ply")
    assert navigator.server.mesh_map is before
    assert navigator.get_path(Pose.planar(3.0, 3.0), planner="astar").success


def test_while_a_goal_uses_a_plugin_the_mesh_stays(navigator):
    server = navigator.server
    before, busy = server.mesh_map, server.plugins.get(PluginKind.PLANNER, "cvp")
    assert busy.acquire("a goal", lambda: True)
    with pytest.raises(ServerError, match="cvp"):
        server.swap_mesh("large.ply")
    busy.release("a goal")
    assert server.mesh_map is before
    assert navigator.get_path(Pose.planar(3.0, 3.0), planner="astar").success


@pytest.mark.parametrize("layout", ["mesh_io", "channels"])
def test_a_saved_map_has_the_costs_of_its_layers_and_is_a_map_again(navigator, tmp_path, layout):
    server = navigator.server

    server.save_map("saved.h5", layout=layout)

    with h5py.File(tmp_path / "saved.h5") as saved:
        slopes = saved[f"mesh/{LAYOUTS[layout][1]}/slopes"][:, 0]
    np.testing.assert_array_equal(slopes, server.mesh_map.to_input_order(server.mesh_map.layers["slopes"].costs))
    assert server.runtime.events.memory.of_kind(EventKind.MAP)[-1].data["message"] == "the map was saved to saved.h5"
    with pytest.raises(MeshError, match="not overwritten"):
        server.save_map("saved.h5")
    server.swap_mesh("saved.h5")
    assert navigator.get_path(Pose.planar(3.0, 3.0), planner="astar").success


def test_layer_parameters_change_at_run_time_and_are_an_event(navigator):
    server = navigator.server
    server.set_layer_parameters("slopes", threshold=0.4)
    server.set_map_parameters("mesh_map", edge_cost_factor=0.5)
    assert server.mesh_map.layers["slopes"].parameters.threshold == 0.4
    assert server.mesh_map.edge_cost_factor == 0.5
    reported = server.runtime.events.memory.of_kind(EventKind.PARAMETER_CHANGED)
    assert reported[-2].data["threshold"] == 0.4 and reported[-1].data["edge_cost_factor"] == 0.5


@pytest.mark.parametrize(
    ("layer", "changes", "error", "text"),
    [
        ("slope", {"threshold": 0.4}, ServerError, "no layer 'slope'; known: mesh_map.slopes"),
        ("slopes", {"threshold": "steep"}, ValueError, "threshold"),
        ("slopes", {"angle": 0.4}, ValueError, "angle"),
    ],
)
def test_a_layer_parameter_that_is_not_legal_changes_nothing(navigator, layer, changes, error, text):
    before = navigator.server.mesh_map.snapshot()
    with pytest.raises(error, match=text):
        navigator.server.set_layer_parameters(layer, **changes)
    assert navigator.server.mesh_map.snapshot() is before


def test_no_controller_drives_on_a_map_whose_layers_did_not_come_through(navigator):
    server = navigator.server

    def raises(layer):
        raise RuntimeError("no idea")

    with pytest.raises(RuntimeError):
        server.mesh_map.apply(raises)
    assert server.map_problem() == "layer 'slopes' raised RuntimeError: no idea"
    assert server.mesh_map.stale_reason(0.0)

    server.mesh_map.clear()
    assert server.map_problem() == ""


def test_the_disc_of_queries_and_the_edge_cost_factor_change_at_run_time_within_their_ranges(navigator):
    server, beside = navigator.server, Pose.planar(2.0, 2.0)
    server.mesh_map.apply(lambda layer: layer.replace(np.full_like(layer.costs, 0.1), np.zeros_like(layer.lethal)))
    narrow = server.queries.check_pose(beside).cost
    server.set_footprint(0.6)
    assert server.queries.check_pose(beside).cost > 2.0 * narrow > 0.0
    for change in (
        lambda: server.set_footprint(-0.1),
        lambda: server.set_footprint(float("nan")),
        lambda: server.set_footprint([(0.3, 0.3), (-0.3, 0.3), (0.0, -0.3)]),
        lambda: server.set_map_parameters("mesh_map", edge_cost_factor=101.0),
    ):
        with pytest.raises(ValueError):
            change()
    assert server.mesh_map.inscribed_radius == 0.6 and server.mesh_map.edge_cost_factor == 0.0
