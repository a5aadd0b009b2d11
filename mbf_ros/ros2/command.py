"""The commands ``mbf ros2``, a node of ROS 2, and ``mbf ros2-interfaces``, which compiles message packages."""

from __future__ import annotations

import sysconfig
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mbf_abstract.commands.foxglove_options import AT, FOXGLOVE, ORIGIN, READ_ONLY, TOKEN, foxglove_of
from mbf_abstract.commands.reporting import FAILURE, readable_errors
from mbf_abstract.commands.waiting import waiting
from mbf_ros.ending import Parent, noticed_ctrl_c, shown_state
from mbf_ros.serving_options import KEEP_GOALS, MAP_PERIOD, MAX_SILENCE, NODE_SENSORS

if TYPE_CHECKING:
    from mbf_ros.ros2.node import NavigationNode


def register(app: typer.Typer) -> None:
    """Add the commands to the application ``mbf``."""
    app.command("ros2")(ros2)
    app.command("ros2-interfaces")(ros2_interfaces)


def ros2(
    context: typer.Context,
    config: Path = typer.Argument(..., metavar="CONFIG", help="A navigation file."),
    sensor: list[str] = NODE_SENSORS,
    stamped: bool = typer.Option(False, "--stamped", help="Publish cmd_vel as TwistStamped."),
    max_silence: float = MAX_SILENCE,
    keep_goals: bool = KEEP_GOALS,
    nav2: bool = typer.Option(
        None, "--nav2/--no-nav2", help="Offer Nav2's names, too; if not given, where nav2_msgs is installed."
    ),
    amcl: bool = typer.Option(
        False, "--amcl", help="Answer Nav2's clients for amcl, too: the robot is localised by something else."
    ),
    map_period: float = MAP_PERIOD,
    foxglove: bool = FOXGLOVE,
    foxglove_at: str = AT,
    foxglove_token: bool = TOKEN,
    foxglove_read_only: bool = READ_ONLY,
    foxglove_origin: list[str] = ORIGIN,
    ros_arguments: list[str] = typer.Argument(
        None,
        metavar="[-- ROS ARGUMENTS]",
        help="As after --ros-args, e.g. -- -r odom:=wheel/odom -p use_sim_time:=true.",
    ),
) -> None:
    """Serve a navigator as the ROS 2 node move_base_flex, until Ctrl-C."""
    parent = Parent()
    with readable_errors():
        from mbf_abstract.access.foxglove import live_robot
        from mbf_ros.ros2.node import navigation_node
        from mbf_ros.ros2.options import NodeOptions
        from mbf_ros.sensor_options import sensors_of

        app = foxglove_of(context)
        options = NodeOptions(
            stamped,
            max_silence or None,
            sensors_of(sensor),
            keep_goals,
            tuple(ros_arguments or ()),
            nav2=nav2,
            stands_for_amcl=amcl,
            map_period=map_period,
        )
        with (
            navigation_node(config, options) as node,
            live_robot(app, node.session, node.go_to, config.stem, typer.echo),
        ):
            _wait_for_end(node, parent)
    if node.failure:
        typer.echo(f"error: the node has stopped the robot and ended: {node.failure}", err=True)
        raise typer.Exit(FAILURE)


def ros2_interfaces(
    packages: list[str] = typer.Argument(None, metavar="[PACKAGE]...", help="Which of them; all if none is given."),
    into: Path = typer.Option(None, "--into", help="Folder for the packages; that of this Python if not given."),
) -> None:
    """Compile map_msgs, mbf_msgs, mesh_msgs, nav2_msgs and tf2_msgs, which the wheels of ROS 2 lack; needs gcc."""
    with readable_errors():
        from mbf_ros.ros2.interfaces.building import build
        from mbf_ros.ros2.interfaces.definitions import PACKAGES

        if unknown := sorted(set(packages or ()).difference(PACKAGES)):
            raise ValueError(f"expected some of the packages {', '.join(PACKAGES)}, got {', '.join(unknown)}")
        for package in packages or PACKAGES:
            with waiting(f"compiling {package}") as on_step:
                target = build(package, into or Path(sysconfig.get_paths()["purelib"]), on_step)
            typer.echo(f"{package}: {target}")


def _wait_for_end(node: NavigationNode, parent: Parent) -> None:
    """Wait for Ctrl-C, the end of the parent or a fault."""
    look = shown_state(node.problem, typer.echo)
    with noticed_ctrl_c() as pressed:
        while not pressed.is_set() and not node.wait(0.1):
            look()
            parent.end_without()
