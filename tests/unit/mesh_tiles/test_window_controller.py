"""A controller for meshes on a window that follows the robot: what it refuses."""

import pytest
from sensing_tiles import OBSTACLES
from test_tile_server import config, pose, serve

from mbf_abstract.geometry import Path, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PluginKind
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.controllers.path_follower import PathFollower

FOLLOWER = "  window: 16.0\ncontrollers: [{name: follower, type: path_follower}]\n"


@pytest.fixture
def places(whole_hills):
    """Two free places (3,) more than a quarter of a window apart."""
    return whole_hills.free_places(2, 15)


def controller_of(server):
    return server.plugins.get(PluginKind.CONTROLLER, "follower").instance


def test_parameters_that_a_controller_refuses_are_not_driven_with(tiled_hills, places, tmp_path, monkeypatch):
    def refuse(controller):
        if controller.parameters.max_vel_x > 2.0:
            raise ValueError("too fast")

    monkeypatch.setattr(PathFollower, "parameters_changed", refuse)
    with LoopbackSession(pose(places[0])) as session:
        server = serve(session, tmp_path, config(tiled_hills, FOLLOWER))
        before = controller_of(server).parameters
        with pytest.raises(ValueError, match="too fast"):
            server.set_plugin_parameters(PluginKind.CONTROLLER, "follower", max_vel_x=3.0)
        assert controller_of(server).parameters is before is controller_of(server)._inner.parameters


def test_a_path_that_a_controller_refuses_on_another_window_is_invalid(tiled_hills, places, tmp_path, monkeypatch):
    robot = pose(places[0])
    request = ControlRequest(robot, Twist())
    with LoopbackSession(robot) as session:
        server = serve(session, tmp_path, config(tiled_hills, FOLLOWER))
        controller = controller_of(server)
        assert controller.set_plan(Path.from_points(places))
        monkeypatch.setattr(PathFollower, "set_plan", lambda self, path: False)
        server.tiled_map.update(pose(places[1]), 1.0)
        result = controller.compute_velocity_commands(request)
    assert result.outcome == ExePathOutcome.INVALID_PATH and "what is left of the path" in result.message


@pytest.mark.parametrize(
    ("more", "refused"),
    [
        ("controllers: [{name: follower, type: path_follower}]\nfollower: {check_ahead_dist: 1.3}\n", ""),
        (
            "controllers: [{name: follower, type: path_follower}]\nfollower: {check_ahead_dist: 4.0}\n",
            r"'follower' \(path_follower\): .*expected more than 24.8 m, got 16 m; .* looks 5 m around the robot, "
            "which drives 0 m between updates, and the layers look 1.2 m around a vertex",
        ),
        (
            "max_vel_x: 2.0\ncontrollers: [{name: follower, type: mppi}]\n",
            "expected more than 19.2 m, got 16 m; .* looks 3.4 m around the robot, which drives 0.2 m between updates",
        ),
        (
            "recovery_behaviors: [{name: out, type: escape}]\nout: {max_distance: 9.0}\n",
            r"'out' \(escape\): .*expected more than 44.8 m, got 16 m; with its parameters it looks 10 m around",
        ),
    ],
)
def test_what_looks_beyond_the_window_is_refused_at_the_start(tiled_hills, places, tmp_path, more, refused):
    """It would take the edge of the window for an obstacle."""
    with LoopbackSession(pose(places[0])) as session:
        text = config(tiled_hills, more, OBSTACLES)
        if not refused:
            serve(session, tmp_path, text)
            return
        with pytest.raises(ServerError, match=refused):
            serve(session, tmp_path, text)


def test_parameters_with_which_a_controller_looks_beyond_the_window_are_refused_at_run_time(
    tiled_hills, places, tmp_path
):
    with LoopbackSession(pose(places[0])) as session:
        server = serve(session, tmp_path, config(tiled_hills, FOLLOWER))
        with pytest.raises(ValueError, match=r"tiled_map.window: expected more than 24 m, got 16 m"):
            server.set_plugin_parameters(PluginKind.CONTROLLER, "follower", check_ahead_dist=5.0)
        assert controller_of(server)._inner.parameters.check_ahead_dist == 1.0
