"""The commands ``mbf bridge``.

``serve`` puts a navigator, or a simulated robot alone, behind a rosbridge server; ``connect`` navigates a robot that
has a rosbridge server, without ROS here.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from mbf_abstract.commands.foxglove_options import AT, FOXGLOVE, ORIGIN, READ_ONLY, TOKEN, foxglove_of
from mbf_abstract.commands.reporting import readable_errors
from mbf_abstract.commands.waiting import waiting
from mbf_ros.ending import Parent, shown_state, wait_for_ctrl_c
from mbf_ros.rosbridge_robot.options import LinkOptions, RobotOptions, TimeSource
from mbf_ros.serving_options import KEEP_GOALS, MAP_PERIOD, MAX_SILENCE, SENSORS, STAMPED

if TYPE_CHECKING:
    from mbf_abstract.access.page_access import PageAccess
    from mbf_abstract.session import NavigationSession
    from mbf_ros.rosbridge.serving import BridgeOptions, RosbridgeServer
    from mbf_ros.rosbridge_robot.topic_robot import TopicRobot

WORLDS_GROUP = "mbf.worlds"
LOOK_PERIOD = 0.1  # s


def register(app: typer.Typer) -> None:
    """Add the commands to the application ``mbf``."""
    bridge = typer.Typer(help="Navigation for clients of rosbridge: roslibpy, roslib pages.", no_args_is_help=True)
    bridge.command("serve")(serve)
    bridge.command("connect")(connect)
    app.add_typer(bridge, name="bridge")


def serve(
    context: typer.Context,
    what: str = typer.Argument(
        ..., metavar="CONFIG|SCENARIO", help="A navigation file, whose robot is a client; or a scenario, simulated."
    ),
    backend: str = typer.Option("", "--backend", help="Map backend of a scenario; its own if not given."),
    seed: int | None = typer.Option(None, "--seed", min=0, help="Seed of a scenario; its own if not given."),
    host: str = typer.Option("127.0.0.1", "--host", help="Interface; others than loopback are not encrypted."),
    port: int = typer.Option(9090, "--port", min=0, max=65535, help="Port; 0 takes a free one."),
    token: bool = typer.Option(
        False, "--token", help="Only for those who know the token in the address; always so beyond loopback."
    ),
    allow_origin: list[str] = typer.Option(
        [], "--allow-origin", help="Origin of a web page that may connect, e.g. https://dash.local; may be repeated."
    ),
    max_message: int = typer.Option(
        10_000_000, "--max-message", min=1000, help="Longest message of a client, in bytes."
    ),
    sensor: list[str] = SENSORS,
    stamped: bool = STAMPED,
    max_silence: float = typer.Option(
        0.0,
        "--max-silence",
        min=0.0,
        help="Time without odometry, transforms or a sensor at which a robot that is a client stops, in s; "
        "0 = command_timeout.",
    ),
    keep_goals: bool = KEEP_GOALS,
    map_period: float = MAP_PERIOD,
    robot_only: bool = typer.Option(
        False, "--robot-only", help="Only the robot of a scenario, for a navigator that connects: see bridge connect."
    ),
    foxglove: bool = FOXGLOVE,
    foxglove_at: str = AT,
    foxglove_token: bool = TOKEN,
    foxglove_read_only: bool = READ_ONLY,
    foxglove_origin: list[str] = ORIGIN,
) -> None:
    """Serve a navigator, or a simulated robot alone, to clients of rosbridge, until Ctrl-C."""
    parent = Parent()
    with readable_errors():
        from mbf_abstract.access.foxglove import live_robot
        from mbf_abstract.access.server_options import ServerOptions
        from mbf_ros.rosbridge.serving import BridgeOptions, serve_session
        from mbf_ros.rosbridge_robot.simulated_robot import serve_robot
        from mbf_ros.sensor_options import sensors_of

        app = foxglove_of(context)
        access = _access(host, token)
        server_options = ServerOptions(access, port, tuple(allow_origin), max_message)
        options = BridgeOptions(server_options, not keep_goals, stamped, sensors_of(sensor), map_period)
        if robot_only and app is not None:
            raise ValueError("--foxglove shows a navigator, which --robot-only leaves out")
        if robot_only and _is_navigation(Path(what)):
            raise ValueError("--robot-only is for scenarios: the robot of a navigation file is a client itself")
        with waiting("reading the configuration") as on_step:
            session, robot = _open(what, backend or None, seed, max_silence, on_step)
        served = serve_robot(session, options) if robot_only else serve_session(session, options, robot)
        with session, served as server:
            _report(server, options, robot is not None)
            with live_robot(app, session, session.navigator.send, Path(what).stem, typer.echo):
                wait_for_ctrl_c(parent)


def _access(host: str, token: bool) -> PageAccess:
    from mbf_abstract.access.page_access import PageAccess, is_loopback

    return PageAccess.by_token(host) if token or not is_loopback(host) else PageAccess.open(host)


def _open(
    what: str, backend: str | None, seed: int | None, max_silence: float, on_step: Callable[[str], None]
) -> tuple[NavigationSession, TopicRobot | None]:
    """A session of a navigation file with a robot that is a client, or of a scenario, simulated."""
    if _is_navigation(Path(what)):
        if backend is not None or seed is not None:
            raise ValueError("--backend and --seed are for scenarios: a navigation file names its backend itself")
        return _real_robot(Path(what), max_silence)
    worlds = [point for point in entry_points(group=WORLDS_GROUP)]
    if not worlds:
        raise ValueError(f"{what} is not a navigation file, and no package with scenarios is installed")
    opener: Callable[..., Any] = worlds[0].load()
    return opener(what, backend, seed, on_step), None


def _is_navigation(file: Path) -> bool:
    """Whether a file is a navigation file; what is wrong with one is found when it is read."""
    from mbf_abstract.config.bounded_files import is_file
    from mbf_abstract.config.yaml_source import load_yaml

    if not is_file(file):
        return False
    return "navigation" not in load_yaml(file).data


def _real_robot(file: Path, max_silence: float) -> tuple[NavigationSession, TopicRobot]:
    from mbf_abstract.geometry.transform_buffer import TransformBuffer
    from mbf_abstract.server.factory import read_config
    from mbf_abstract.session import NavigationSession
    from mbf_abstract.time.clock import WallClock
    from mbf_ros.ros2.robot import Frames
    from mbf_ros.rosbridge_robot.topic_robot import TopicRobot

    server_class, config = read_config(file)
    session, transforms = NavigationSession(WallClock()), TransformBuffer(config.parameters.tf_cache_time)
    parameters = config.parameters
    robot = TopicRobot(
        transforms,
        session.clock,
        Frames(parameters.global_frame, parameters.robot_frame),
        lambda: max_silence or session.navigator.server.runtime.parameters.command_timeout,
        parameters.use_odometry,
    )
    session.serve(server_class, config, robot, transforms)
    return session, robot


def _report(server: RosbridgeServer, options: BridgeOptions, is_real: bool) -> None:
    """Print where clients connect, and what they should know."""
    from mbf_abstract.access.page_access import Role, is_loopback

    access = options.server.access
    for role, text in ((Role.STEER, "page"), (Role.WATCH, "page, to watch only")):
        if address := access.address(server.port, role):
            typer.echo(f"{text}: {address}")
            typer.echo(f"rosbridge: {address.replace('http', 'ws', 1)}")
    if is_real:
        typer.echo("the robot is the client that publishes /odom and /tf and listens to /cmd_vel")
    if not is_loopback(access.host):
        typer.echo(
            f"warning: other machines can reach {access.host}, and nothing is encrypted; who has or overhears the "
            "address can drive the robot",
            err=True,
        )


def connect(
    context: typer.Context,
    address: str = typer.Argument(..., metavar="ADDRESS", help="The robot's rosbridge, e.g. ws://robot:9090."),
    config: Path = typer.Argument(..., metavar="CONFIG", help="A navigation file."),
    sensor: list[str] = SENSORS,
    stamped: bool = STAMPED,
    max_silence: float = MAX_SILENCE,
    cloud_period: float = typer.Option(
        0.1, "--cloud-period", min=0.0, help="Least time between two clouds of a topic, in s."
    ),
    time: TimeSource = typer.Option(
        TimeSource.CALENDAR,
        "--time",
        help="What shows the time of the robot's stamps: the calendar, odometry as it arrives, or the topic /clock.",
    ),
    secret_file: Path = typer.Option(
        None, "--secret-file", help="File with the secret of a rosbridge that asks for auth.", dir_okay=False
    ),
    foxglove: bool = FOXGLOVE,
    foxglove_at: str = AT,
    foxglove_token: bool = TOKEN,
    foxglove_read_only: bool = READ_ONLY,
    foxglove_origin: list[str] = ORIGIN,
) -> None:
    """Navigate a robot through its rosbridge server, until Ctrl-C."""
    parent = Parent()
    with readable_errors():
        from mbf_abstract.access.foxglove import live_robot
        from mbf_ros.rosbridge_robot.navigator import connect_navigator
        from mbf_ros.sensor_options import sensors_of

        app = foxglove_of(context)
        link = LinkOptions(secret=secret_file.read_text("utf-8").strip() if secret_file else "")
        options = RobotOptions(link, stamped, max_silence or None, sensors_of(sensor), cloud_period, time)
        with connect_navigator(address, config, options, _warn) as navigator:
            with live_robot(app, navigator.session, navigator.go_to, config.stem, typer.echo):
                wait_for_ctrl_c(parent, shown_state(navigator.problem, typer.echo), LOOK_PERIOD)


def _warn(text: str) -> None:
    typer.echo(f"warning: {text}", err=True)
