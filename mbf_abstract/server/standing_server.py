"""A server without a simulator: a robot that stands at one pose, on simulated time. For planning and checking."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from mbf_abstract.config.bounded_files import is_there
from mbf_abstract.config.configuration import Config
from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.installed_plugins import installed_points
from mbf_abstract.config.yaml_source import read_yaml
from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Command, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_types import GetPathGoal, RefinePathGoal
from mbf_abstract.goals.result_types import GetPathResult, RefinePathResult
from mbf_abstract.maps.view import UNKNOWN_OCCUPANCY, FloorMap
from mbf_abstract.navigator import Navigator
from mbf_abstract.server.factory import MAP_FILES_GROUP, installed_servers, read_config
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import Clock

YAML_SUFFIXES = {".yaml", ".yml"}


class StandingRobot:
    """A robot that never moves; commands to it are a mistake of the caller and have no effect.

    ``min_turning_radius`` is that of the one it stands in for [m].
    """

    def __init__(self, clock: Clock, min_turning_radius: float = 0.0) -> None:
        self._clock, self.min_turning_radius = clock, min_turning_radius

    def send_command(self, command: Command) -> None:
        """Stay."""

    def odometry(self) -> Odometry:
        """Return zero velocity, measured now."""
        return Odometry(Twist(), self._clock.now())


@contextmanager
def standing_server(
    cls: type[AbstractNavigationServer], config: Config, min_turning_radius: float = 0.0
) -> Iterator[AbstractNavigationServer]:
    """Build a server around a robot that stands at the origin; it is closed at the end.

    ``min_turning_radius`` [m] is that of the robot it stands in for.
    """
    with NavigationSession() as session:
        server = session.serve(cls, config, StandingRobot(session.clock, min_turning_radius))
        place_robot(server, Pose.planar(0.0, 0.0, frame_id=config.parameters.global_frame))
        yield server


def place_robot(server: AbstractNavigationServer, pose: Pose) -> None:
    """Let the robot stand at ``pose`` (in the global frame) from now on."""
    frame = server.config.parameters.robot_frame
    transform = Transform(pose.position, pose.orientation, parent=pose.frame_id, child=frame, static=True)
    server.runtime.transforms.set(transform)


def read_config_or_map(file: Path, unknown: str = "") -> tuple[type[AbstractNavigationServer], Config, list[str]]:
    """Read a configuration, or make a default one for a bare map or mesh file, or a folder of a map.

    Parameters
    ----------
    unknown : {"", "free", "lethal"}
        State of the unknown cells of a bare map; "" is free. A configuration has its own parameters for it.

    Returns
    -------
    server, config
    notes : list of str
        What a user should know of the default configuration.

    Raises
    ------
    ConfigError
        There is no such file, no installed server reads its format, it is a configuration with mistakes, or a state of
        unknown cells is given for what has none.
    """
    if not is_there(file):
        raise ConfigError([Finding(str(file), 1, "", "a configuration, map or mesh file", "no such file")])
    if file.is_file() and file.suffix.lower() in YAML_SUFFIXES and not _is_map_description(file):
        if unknown:
            expected = "a bare map: a configuration has track_unknown_space and allow_unknown for this"
            raise ConfigError([Finding(str(file), 1, "", expected, f"--unknown {unknown} with a configuration")])
        return *read_config(file), []
    for cls in installed_servers(file.suffix):
        text = cls.config_for_map(file.resolve(), unknown_is_free=unknown != "lethal")
        if text is not None:
            floor = cls.read_floor(file)
            if unknown and floor is None:
                expected = "a bare map with cells: a mesh knows no unknown ground, where there is none it has a hole"
                raise ConfigError([Finding(str(file), 1, "", expected, f"--unknown {unknown} with {file.name}")])
            return *read_config_text(text), _unknown_note(floor, unknown)
    if file.is_dir():
        expected = "a configuration, map or mesh file, or a folder of tiles (mbf map tile)"
        raise ConfigError([Finding(str(file), 1, "", expected, "a folder of something else")])
    endings = ", ".join(sorted(f".{point.name}" for point in installed_points(MAP_FILES_GROUP)))
    expected = f"a configuration, map or mesh ({endings}); of a point cloud, mbf map build makes a mesh"
    raise ConfigError([Finding(str(file), 1, "", expected, f"a file that ends with {file.suffix!r}")])


def _unknown_note(floor: FloorMap | None, unknown: str) -> list[str]:
    """Note that unknown cells of a bare map count as free, unless that was asked for."""
    count = 0 if floor is None else int(np.count_nonzero(floor.occupancy == UNKNOWN_OCCUPANCY))
    if floor is None or count == 0 or unknown:
        return []
    share = 100.0 * count / floor.occupancy.size
    return [f"{count} cells ({share:.0f} %) are unknown and count as free; --unknown lethal keeps plans out of them"]


def _is_map_description(file: Path) -> bool:
    """Whether a YAML file describes a map's image (map_server) and is no configuration."""
    document = read_yaml(file, [])
    return document is not None and "image" in document.data and "backend" not in document.data


def read_config_text(text: str) -> tuple[type[AbstractNavigationServer], Config]:
    """Read a configuration that is no file; paths in it are absolute."""
    with tempfile.TemporaryDirectory(prefix="mbf_plan_") as folder:
        file = Path(folder) / "default_configuration.yaml"
        file.write_text(text, encoding="utf-8")
        return read_config(file)


def planned(server: AbstractNavigationServer, goal: GetPathGoal) -> tuple[GetPathResult, str]:
    """Plan, and send the plan through the configuration's ``plan_refiner``; the text says why that failed.

    The cost stays that of the plan before.
    """
    navigator, refiner = Navigator(server), server.config.parameters.plan_refiner
    plan: GetPathResult = navigator.send(goal).wait()
    if plan.path is None or not plan.success or not refiner:
        return plan, ""
    refined: RefinePathResult = navigator.send(RefinePathGoal(plan.path, refiner)).wait()
    problem = "" if refined.success else f"{refiner} did not refine the path: {refined.outcome_name}: {refined.message}"
    message = f"{plan.message}; refined by {refiner}, the cost is that before" if refined.success else plan.message
    return replace(plan, path=refined.refined_path, message=message), problem
