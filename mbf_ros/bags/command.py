"""The command ``mbf bag``: bags of ROS replayed through our layers, maps taken from them, runs written as bags."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from mbf_abstract.commands.coordinates import CoordinateCommand, parse_place
from mbf_abstract.commands.reporting import FAILURE, readable_errors
from mbf_abstract.commands.waiting import waiting

if TYPE_CHECKING:
    from mbf_abstract.geometry.transform import Transform
    from mbf_ros.bags.replay import Replayed


def register(app: typer.Typer) -> None:
    """Add the commands to the application ``mbf``."""
    bag = typer.Typer(help="Bags of ROS 1 and ROS 2, without ROS.", no_args_is_help=True)
    bag.command("replay", cls=CoordinateCommand)(replay)
    bag.command("map")(recorded_map)
    bag.command("points")(points)
    bag.command("export")(export)
    app.add_typer(bag, name="bag")


def replay(
    bag: Path = typer.Argument(..., help="A .bag file of ROS 1; a folder, .mcap or .db3 file of ROS 2."),
    config: Path = typer.Argument(..., help="Configuration of the robot: its maps, layers and planners."),
    out: Path | None = typer.Option(None, "--out", help="Folder for the results; replays/<name> if not given."),
    goal: str = typer.Option("", "--goal", metavar="X Y [Z] [YAW]", help="Plan to this place [m, rad]."),
    at: float = typer.Option(math.inf, "--at", min=0.0, help="With --goal: plan so many seconds after the beginning."),
    planner: str = typer.Option("", "--planner", help="With --goal: name of the planner; the first one if not given."),
    topic: list[str] = typer.Option(
        [], "--topic", metavar="WHAT=TOPIC", help="Topic of tf, tf_static, odom or a source of CONFIG; empty for none."
    ),
    tf: list[str] = typer.Option(
        [], "--tf", metavar="PARENT:CHILD=X,Y,Z,YAW", help="A transform that does not change and is not in the bag."
    ),
    odom_tf: bool = typer.Option(False, "--odom-tf", help="Take the poses of odometry for transforms."),
    map_name: str = typer.Option("", "--map", help="Which map or layer to show; what planners see if not given."),
    every: float = typer.Option(0.0, "--every", min=0.0, help="Seconds between two pictures; ten pictures if 0."),
    as_json: bool = typer.Option(False, "--json", help="Print statistics and plan as one JSON object."),
) -> None:
    """Replay a bag through transform buffer and layers; exit code 1 if a plan was asked for and failed.

    Results: report.html, statistics.json, plan.json, run.mcap, and the map over time in pictures.
    """
    place = parse_place(goal, "--goal") if goal else None
    if place is None and (math.isfinite(at) or planner):
        raise typer.BadParameter("it goes with --goal only", param_hint="--at" if math.isfinite(at) else "--planner")
    with readable_errors(out):
        from mbf_abstract.drive_log import write_drive_log
        from mbf_abstract.server.factory import read_config
        from mbf_ros.bags.reading import open_bag
        from mbf_ros.bags.replay import replay_bag
        from mbf_ros.bags.replay_options import ReplayOptions
        from mbf_ros.bags.report import missing_notes, report_of, result_line, statistics_of

        options = ReplayOptions(_pairs(topic), _transforms(tf), odom_tf, map_name, place, at, planner, every)
        folder = out or Path("replays") / bag.resolve().stem
        with waiting("reading the configuration") as on_step:
            with open_bag(bag) as opened:
                replayed = replay_bag(opened, *read_config(config), options, on_step)
            on_step("writing the results")
            folder.mkdir(parents=True, exist_ok=True)
            _write_json(folder / "statistics.json", {"bag": bag.name, **statistics_of(replayed)})
            (folder / "plan.json").unlink(missing_ok=True)
            if replayed.plan is not None:
                _write_json(folder / "plan.json", replayed.plan)
            problems = write_drive_log(folder, replayed.log, report_of(replayed))
        for problem in (*missing_notes(replayed), *problems):
            typer.echo(f"note: {problem}", err=True)
        if as_json:
            typer.echo(json.dumps({**statistics_of(replayed), "plan": replayed.plan, "folder": str(folder)}))
        else:
            typer.echo(result_line(replayed))
            plan = "" if replayed.plan is None else " plan.json,"
            typer.echo(f"results in {folder}: report.html, statistics.json,{plan} run.mcap, map_*.png")
    if _has_failed(replayed):
        raise typer.Exit(FAILURE)


def recorded_map(
    bag: Path = typer.Argument(..., help="A .bag file of ROS 1; a folder, .mcap or .db3 file of ROS 2."),
    out: Path = typer.Option(Path("map.yaml"), "--out", help="YAML file of map_server; an image is written beside it."),
    topic: str = typer.Option("", "--topic", help="Topic of the map, where the bag has several."),
    at: float = typer.Option(math.inf, "--at", min=0.0, help="The map so many seconds after the beginning."),
) -> None:
    """Write the recorded map, the last one or that of a time, as a file for static layers."""
    with readable_errors(out):
        from mbf_ros.bags.reading import open_bag
        from mbf_ros.bags.recorded_map import map_topic, read_recorded_map, write_recorded_map

        if out.suffix not in (".yaml", ".yml"):
            raise typer.BadParameter(f"expected a .yaml file, got {str(out)!r}", param_hint="--out")
        with waiting("reading the bag"), open_bag(bag) as opened:
            message = read_recorded_map(opened, map_topic(opened, topic), at)
            write_recorded_map(out, message)
    info = message["info"]
    typer.echo(f"{out}: {info['width']} x {info['height']} cells of {info['resolution']:.3g} m")


def points(
    bag: Path = typer.Argument(..., help="A .bag file of ROS 1; a folder, .mcap or .db3 file of ROS 2."),
    out: Path = typer.Option(Path("points.ply"), "--out", help="The point cloud, a .ply file."),
    frame: str = typer.Option("map", "--frame", help="Frame of the points, e.g. odom where there is no localisation."),
    sensors: list[str] = typer.Option(
        [], "--points", metavar="TOPIC", help="Topic of a sensor; all point clouds if not given, or else all scans."
    ),
    topic: list[str] = typer.Option([], "--topic", metavar="WHAT=TOPIC", help="Topic of tf, tf_static or odom."),
    tf: list[str] = typer.Option(
        [], "--tf", metavar="PARENT:CHILD=X,Y,Z,YAW", help="A transform that does not change and is not in the bag."
    ),
    odom_tf: bool = typer.Option(False, "--odom-tf", help="Take the poses of odometry for transforms."),
    max_range: float = typer.Option(math.inf, "--max-range", min=0.0, help="Leave out points farther away [m]."),
    every: int = typer.Option(1, "--every", min=1, help="Take every n-th scan of a topic."),
) -> None:
    """Write what the sensors hit, in one frame, as a point cloud for mbf map build."""
    with readable_errors(out):
        from mbf_ros.bags.reading import open_bag
        from mbf_ros.bags.recorded_points import PointOptions, read_recorded_points, write_points
        from mbf_ros.bags.replay_options import ReplayOptions

        if out.suffix != ".ply":
            raise typer.BadParameter(f"expected a .ply file, got {str(out)!r}", param_hint="--out")
        chosen = PointOptions(frame.lstrip("/"), tuple(sensors), max_range, every)
        with waiting("reading the bag"), open_bag(bag) as opened:
            found = read_recorded_points(opened, chosen, ReplayOptions(_pairs(topic), _transforms(tf), odom_tf))
            write_points(out, found.points, chosen.frame)
    for reason, count in found.left_out.most_common():
        typer.echo(f"note: {count} scans left out, {reason}", err=True)
    typer.echo(f"{out}: {len(found.points)} points of {found.scans} scans; mbf map build {out} --out MAP.ply")


def export(
    run: Path = typer.Argument(..., help="Folder of a run, e.g. runs/2030-01-02_03-04-05."),
    out: Path | None = typer.Option(None, "--out", help="Folder of the bag, a new one; RUN/bag if not given."),
    robot_frame: str = typer.Option("base_link", "--robot-frame", help="Name of the robot's frame in the bag."),
) -> None:
    """Write a run as a bag of ROS 2 (mcap) with standard messages; the same run gives the same bytes."""
    with readable_errors(out):
        from mbf_abstract.drive_log import read_drive_log
        from mbf_ros.bags.export import messages_of
        from mbf_ros.bags.writing import write_bag

        folder = out or run / "bag"
        with waiting("reading the run") as on_step:
            log = read_drive_log(run)
            on_step("writing the bag")
            counts = write_bag(folder, messages_of(log, robot_frame))
    for topic in sorted(counts):
        typer.echo(f"{counts[topic]:7} {topic}")
    typer.echo(f"bag in {folder}")


def _has_failed(replayed: Replayed) -> bool:
    from mbf_abstract.outcomes import is_success

    return replayed.plan is not None and not is_success(replayed.plan["outcome"])


def _write_json(file: Path, content: Any) -> None:
    from mbf_abstract.whole_files import write_whole

    write_whole(file, json.dumps(content, indent=1, allow_nan=False) + "\n")


def _pairs(texts: list[str]) -> dict[str, str]:
    pairs = {}
    for text in texts:
        what, equals, topic = text.partition("=")
        if not what or not equals:
            raise typer.BadParameter(f"expected WHAT=TOPIC, got {text!r}", param_hint="--topic")
        pairs[what] = topic
    return pairs


def _transforms(texts: list[str]) -> tuple[Transform, ...]:
    """Transforms of ``PARENT:CHILD=X,Y,Z,YAW``."""
    from mbf_abstract.geometry import Pose
    from mbf_abstract.geometry.transform import Transform

    found = []
    for text in texts:
        names, _, numbers = text.partition("=")
        parent, _, child = names.partition(":")
        try:
            x, y, z, yaw = (float(number) for number in numbers.split(","))
            pose, frames = Pose.planar(x, y, yaw, z), (parent.lstrip("/"), child.lstrip("/"))
            found.append(Transform(pose.position, pose.orientation, *frames, static=True))
        except ValueError as error:
            expected = "PARENT:CHILD=X,Y,Z,YAW of two frames, in metres and radians"
            raise typer.BadParameter(f"expected {expected}, got {text!r}", param_hint="--tf") from error
    return tuple(found)
