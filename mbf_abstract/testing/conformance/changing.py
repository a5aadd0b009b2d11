"""What changes while a goal runs: parameters of the server, plugins and layers, and a layer that breaks."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from mbf_abstract.geometry import Path
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import ExePathOutcome, RecoveryOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.conformance.planning import FACE, WALL
from mbf_abstract.testing.conformance.rig import ROBOT_RADIUS, Box
from mbf_abstract.testing.conformance.site import Site, situation


@situation()
def limits_change_while_driving(site: Site) -> None:
    """A limit of the server that changes while the robot drives takes effect at once, and the drive goes on."""
    handle = site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (6.0, 4.0))))
    site.expect_moves(1.0, "before the change")
    site.server.set_parameters(max_vel_x=0.1)
    site.rig.clock.sleep(0.2)
    before = site.rig.robot.pose
    site.rig.clock.sleep(1.0)
    moved = before.distance_to(site.rig.robot.pose)
    site.expect(0.05 < moved < 0.12, f"with max_vel_x 0.1 m/s the robot moved {moved:.2f} m in a second")
    site.server.set_parameters(max_vel_x=None)
    site.expect_outcome(handle.wait(60.0), ExePathOutcome.SUCCESS)


@situation(controller_max_retries=0)
def a_robot_that_grows_no_longer_fits(site: Site) -> None:
    """A larger footprint counts at once: beside an obstacle the drive ends with BLOCKED_PATH, without a contact."""
    site.place(Box(5.0, 4.5, 5.4, 5.0))
    handle = site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (8.0, 4.0))))
    site.expect_moves(1.0, "before it grows")
    site.server.set_footprint(0.7)
    site.expect_outcome(handle.wait(60.0), ExePathOutcome.BLOCKED_PATH)
    gap = site.rig.least_gap()
    site.expect(gap > 0.6, f"the robot's centre came to {gap:.2f} m from an obstacle")
    site.server.set_footprint(ROBOT_RADIUS)
    pose = site.rig.robot.pose
    result = site.navigator.exe_path(site.path((pose.x, pose.y), (pose.x, 4.0), (8.0, 4.0)))
    site.expect_outcome(result, ExePathOutcome.SUCCESS)


@situation()
def a_bad_change_changes_nothing(site: Site) -> None:
    """A value that is not legal is a ValueError and changes nothing; an unknown plugin is a ServerError."""
    server = site.server
    set_parameters = server.set_plugin_parameters
    site.expect_raises(ValueError, lambda: server.set_parameters(controller_frequency=-1.0), "a negative frequency")
    wrong: list[tuple[type[Exception], str, float]] = [(ValueError, "wait", -1.0), (ServerError, "unknown", 1.0)]
    for error, name, duration in wrong:

        def change(name: str = name, duration: float = duration) -> None:
            set_parameters(PluginKind.RECOVERY, name, duration=duration)

        site.expect_raises(error, change, f"duration {duration:g} of {name!r}")
    site.expect_raises(ValueError, lambda: server.set_footprint(-1.0), "a footprint of -1 m")
    site.expect_raises(ServerError, lambda: server.set_layer_parameters("unknown", enabled=True), "an unknown layer")
    site.expect_raises(ServerError, lambda: server.set_map_parameters("unknown", max_age=1.0), "an unknown map")
    bad = site.navigator.recover("wait", parameters={"duration": -1.0})
    site.expect_outcome(bad, RecoveryOutcome.FAILURE, "'wait'", "duration")
    site.expect_outcome(site.navigator.exe_path(site.path((2.0, 4.0), (3.0, 4.0))), ExePathOutcome.SUCCESS)


@situation()
def a_bad_change_is_named(site: Site) -> None:
    """The error of a value that is not legal names the key, what was expected (unit, range) and what came."""
    server, radius = site.server, site.server.set_footprint
    places = [f"{served.name}.{layer}" for served in server.served.values() for layer in served.map.layers]
    for what, change, texts in (
        (
            "two wrong parameters",
            lambda: server.set_parameters(controller_frequency=-1.0, planner_patience="soon"),
            (
                "controller_frequency: expected a number > 0 and <= 100 Hz, got -1.0",
                "planner_patience: expected a number >= 0 and <= 100 s, got 'soon'",
            ),
        ),
        (
            "an unknown parameter",
            lambda: server.set_parameters(controler_frequency=5.0),
            ("controler_frequency: expected a known key, got 'controler_frequency' (did you mean 'controller_freq",),
        ),
        (
            "a plugin's parameter",
            lambda: server.set_plugin_parameters(PluginKind.RECOVERY, "wait", duration=-1.0),
            ("wait.duration: expected a number >= 0 and <= 600 s, got -1.0",),
        ),
        (
            "a layer's parameter",
            lambda: server.set_layer_parameters(places[0], enabled="perhaps"),
            (f"{places[0]}.enabled: expected true or false, got 'perhaps'",),
        ),
        ("a radius below 0", lambda: radius(-1.0), ("radius: expected a number >", " 0", " m, got -1.0")),
        ("a radius of NaN", lambda: radius(float("nan")), ("radius: expected a finite number", " m, got nan")),
        ("a flag for a radius", lambda: radius(True), ("footprint: expected ", "radius in m", "got True")),
        ("a text for corners", lambda: radius("round"), ("footprint: expected ", "got 'round'")),
        ("no footprint", lambda: radius(None), ("footprint: expected ", "radius in m", "got nothing")),
    ):
        site.expect_raises(ValueError, change, what, *texts)


@situation(controller_patience=30.0)
def a_layer_is_switched_off_while_driving(site: Site) -> None:
    """A layer that is switched off while the robot stands before its obstacle lets it drive on, and comes back."""
    site.place(WALL)
    handle = site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (6.0, 4.0))))
    site.rig.clock.sleep(8.0)  # slowly, as it might be somebody who sets off
    site.expect_stands(1.0, "the path leads into the wall")
    _set_sensing_layers(site, enabled=False)
    site.expect_free(FACE)
    site.expect_moves(0.4, "the layer with the wall is switched off")
    _set_sensing_layers(site, enabled=True)
    site.rig.clock.sleep(1.0)
    site.server.queries.update_map()
    back = site.server.queries.check_point(FACE).state  # a map may free what lies under the robot
    site.expect(back in (CellState.LETHAL, CellState.INSCRIBED), f"the wall is {back.name} with the layer switched on")
    handle.cancel("seen enough")


@situation(controller_patience=30.0)
def a_layer_that_raises_holds_the_robot(site: Site) -> None:
    """A layer that raises holds the robot and is named with what it raised; once it works again the robot drives on."""
    for layer in site.map.layers.values():
        handle = site.navigator.send(ExePathGoal(_long_path(site)))
        site.expect_moves(1.5, f"before the layer {layer.name!r} raises")
        repair = _break(layer)
        site.rig.clock.sleep(1.0)
        site.expect_stands(2.5, f"the layer {layer.name!r} raises")
        problem = site.server.map_problem()
        for word in (repr(layer.name), "RuntimeError", "broken by the suite"):
            site.expect(word in problem, f"map_problem does not name {word}: {problem!r}")
        repair()
        site.expect_moves(2.5, f"the layer {layer.name!r} works again")
        handle.cancel("next layer")
        site.rig.clock.sleep(0.5)
    site.rig.sensor_errors.clear()  # a layer may raise in the thread of the sensor


def _long_path(site: Site) -> Path:
    """Path from the robot to the farther end of the ground."""
    pose = site.rig.robot.pose
    return site.path((pose.x, pose.y), (10.0 if pose.x < 6.0 else 2.0, 4.0))


def _set_sensing_layers(site: Site, enabled: bool) -> None:
    server = site.server
    for served in server.served.values():
        for name, layer in served.map.layers.items():
            if layer.source_names:
                server.set_layer_parameters(f"{served.name}.{name}", enabled=enabled)
    site.server.queries.update_map()


def _break(layer: Any) -> Callable[[], None]:
    """Let every method of a layer raise that its map calls to compute it; returns what repairs it."""

    def broken(*_: Any, **__: Any) -> Any:
        raise RuntimeError("broken by the suite")

    asked = {
        "stale_reason",
        "listens_to",
        "configuration_warning",
        "speed_limit",
        "speed_limit_at",
        "shift",
        "insert_scan",
    }
    members = {name: getattr(type(layer), name) for name in dir(type(layer)) if not name.startswith("_")}
    methods = [name for name, member in members.items() if inspect.isfunction(member) and name not in asked]
    for name in methods:
        setattr(layer, name, broken)

    def repair() -> None:
        for name in methods:
            delattr(layer, name)

    return repair
