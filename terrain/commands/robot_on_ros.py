"""The option ``--ros2`` of ``mbf run``: somebody else drives, over ROS 2."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.yaml_source import load_yaml
from terrain.outside.driver import OutsideOptions, outside_executive

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from terrain.scenarios.robots import Sensor
    from terrain.scenarios.scenario import Scenario
    from terrain.session.executives import GoalExecutive
    from terrain.session.run_options import RunOptions
    from terrain.session.session import Session

LINKS_GROUP = "mbf.robot_links"
ROS2 = "ros2"


def driven_over_ros(options: RunOptions, stamped: bool, lockstep: bool, patience: float) -> RunOptions:
    """Let the robot of a run be driven over ROS 2; the connection is made by the package that knows ROS.

    Raises
    ------
    ValueError
        No such package is installed, ROS 2 is not, or the options name who else decides, or another clock.
    """
    if options.wall_clock or options.executive != "move_base":
        given = "--wall-clock" if options.wall_clock else "--executive"
        raise ValueError(f"{given} does not go with --ros2: time passes as real time there, and others decide")
    makers = [point.load() for point in entry_points(group=LINKS_GROUP, name=ROS2)]
    if not makers:
        raise ValueError("no package that connects robots with ROS 2 is installed")
    outside = OutsideOptions(makers[0](stamped), lockstep, patience)

    def make(session: Session) -> GoalExecutive:
        executive = outside_executive(session, outside)
        options.on_note(f"the robot waits for cmd_vel; our navigation for it: {_our_navigation(session, stamped)}")
        return executive

    return replace(options, executive=ROS2, outside=make)


def require_one_robot(scenario: Scenario, file: Path) -> None:
    """Raise ConfigError for a scenario with several robots, which ``file`` describes."""
    if scenario.robots:
        document = load_yaml(file)
        raise ConfigError([document.finding(("robots",), "one robot, with --ros2", f"{len(scenario.robots)}")])


def _our_navigation(session: Session, stamped: bool) -> str:
    """Return the command that drives the robot with the configuration of its scenario."""
    sensors = sensor_options(session.scenario.sensors)
    commands = ["--stamped"] if stamped else []
    config = str(session.folder / "navigation.yaml")
    return " ".join(["mbf ros2", config, *sensors, *commands, "--max-silence 5", "-- -p use_sim_time:=true"])


def sensor_options(sensors: Sequence[Sensor]) -> list[str]:
    """Return the options that feed the topics of a robot's sensors; of several each has topics of its own."""
    prefixes = {one.name: f"{one.name}/" if len(sensors) > 1 else "" for one in sensors}
    return [
        f"--sensor {prefixes[one.name]}"
        + (f"scan:LaserScan={one.name}" if one.type == "planar" else f"points:PointCloud2={one.name}")
        for one in sensors
    ]
