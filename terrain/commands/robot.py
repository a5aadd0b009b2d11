"""``mbf robot show``: what is known of a robot from its URDF, as a table and as a picture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mbf_abstract.commands.reporting import readable_errors

if TYPE_CHECKING:
    from terrain.description.description import RobotDescription


def register(app: typer.Typer) -> None:
    """Add the commands to the application ``mbf``."""
    robot = typer.Typer(help="Robots, as their URDF describes them.", no_args_is_help=True)
    robot.callback()(_group)
    robot.command("show")(show)
    app.add_typer(robot, name="robot")


def _group() -> None:
    """Robots, as their URDF describes them."""


def show(
    robot: str = typer.Argument(..., help="A URDF: a file, or package://NAME/... ."),
    settings: list[str] = typer.Option(
        [], "--set", help="KEY=VALUE: a key that a scenario's robot has, such as drive=omni; repeatable."
    ),
    png: Path | None = typer.Option(None, "--png", help="Draw it from above and from the side into this file."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Print what is found in a URDF: wheels and drive, outline, masses, and slopes, ramps and crests it can take."""
    with readable_errors(png):
        from terrain.description.describe import describe
        from terrain.description.facts import lines_of, to_json
        from terrain.description.parameters import stated_robot

        described = describe(stated_robot(robot, settings))
        if png is not None:
            from terrain.viewer.pictures.robot_picture import write_robot_picture

            write_robot_picture(png, described)
        if as_json:
            typer.echo(json.dumps(to_json(described)))
        else:
            _print(described, lines_of(described))
            if png is not None:
                typer.echo(png.resolve())


def _print(robot: RobotDescription, lines: list[tuple[str, str]]) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(f"{robot.urdf.name} ({robot.urdf.file.name})"), show_header=False, title_justify="left")
    for name, text in lines:
        table.add_row(name, escape(text))
    Console().print(table)
    for note in robot.notes:
        typer.echo(f"note: {note}")
