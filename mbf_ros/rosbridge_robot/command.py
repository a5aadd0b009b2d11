"""The command ``mbf bridge connect``: navigation for a robot that has a rosbridge server, without ROS here."""

from __future__ import annotations

from pathlib import Path

import typer

from mbf_abstract.commands.foxglove_options import AT, FOXGLOVE, ORIGIN, READ_ONLY, TOKEN, foxglove_of
from mbf_abstract.commands.reporting import readable_errors
from mbf_ros.ending import Parent, shown_state, wait_for_ctrl_c
from mbf_ros.rosbridge_robot.options import LinkOptions, RobotOptions, TimeSource
from mbf_ros.serving_options import MAX_SILENCE, SENSORS, STAMPED

LOOK_PERIOD = 0.1  # s


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
