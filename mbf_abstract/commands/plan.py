"""``mbf plan``: one path on a map, without a robot and without a simulator."""

from __future__ import annotations

import json
import math
from contextlib import ExitStack
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from mbf_abstract.commands.coordinates import CoordinateCommand, Place, parse_place
from mbf_abstract.commands.reporting import FAILURE, readable_errors
from mbf_abstract.commands.waiting import waiting

if TYPE_CHECKING:
    from mbf_abstract.config.configuration import Config
    from mbf_abstract.geometry import Pose
    from mbf_abstract.geometry.survey import Survey
    from mbf_abstract.goals.result_types import GetPathResult
    from mbf_abstract.server.navigation_server import AbstractNavigationServer


class Unknown(str, Enum):
    """What the cells that a map does not know are for a plan."""

    FREE = "free"
    LETHAL = "lethal"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("plan", cls=CoordinateCommand)(plan)


def plan(
    config: Path = typer.Argument(
        ..., help="Configuration, bare map (yaml, png, pgm) or mesh (ply, obj, ...), or folder of tiles."
    ),
    start: str = typer.Option(..., "--start", metavar="X Y [Z] [YAW]", help="Where the robot stands [m, rad]."),
    goal: str = typer.Option(..., "--goal", metavar="X Y [Z] [YAW]", help="Where it shall go [m, rad]."),
    planner: str = typer.Option("", "--planner", help="Name of the planner; the first one if not given."),
    tolerance: float = typer.Option(
        0.0, "--tolerance", min=0.0, max=1000.0, help="How far from the goal the path may end [m]."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object, with all poses."),
    survey: bool = typer.Option(
        False, "--survey", help="Start, goal and poses are in coordinates of the survey of the map; degrees: LON LAT."
    ),
    unknown: Unknown | None = typer.Option(
        None, "--unknown", help="Whether unknown cells of a bare map are free (the default, with a note) or lethal."
    ),
    png: Path | None = typer.Option(None, "--png", help="Draw map and path into this file."),
) -> None:
    """Plan a path; exit code 0 only if there is one.

    Without Z the lowest free ground is taken; on a flat map three numbers are X Y YAW.
    """
    from_place, to_place = parse_place(start, "--start"), parse_place(goal, "--goal")
    with readable_errors(png):
        from mbf_abstract.commands.plan_picture import draw_plan
        from mbf_abstract.commands.survey_places import refuse_elsewhere, survey_of
        from mbf_abstract.compiling.compilation import record_compilations
        from mbf_abstract.goals.goal_types import GetPathGoal
        from mbf_abstract.server.standing_server import place_robot, planned, read_config_or_map, standing_server
        from mbf_abstract.time.clock import wall_seconds

        cls, checked, notes = read_config_or_map(config, "" if unknown is None else unknown.value)
        _require_planner(checked, planner)
        with ExitStack() as open_server:
            with waiting("building the map and its layers"):
                server = open_server.enter_context(standing_server(cls, checked))
            notes += server.notes
            surveyed = survey_of(server, config) if survey else None
            if surveyed is not None:
                refuse_elsewhere(surveyed, config, start=from_place, goal=to_place)
            start_pose = _pose("start", from_place, server, notes, surveyed)
            goal_pose = _pose("goal", to_place, server, notes, surveyed)
            place_robot(server, start_pose)
            began = wall_seconds()
            with waiting("planning") as say, record_compilations(lambda name: say(f"compiling {name}")) as compiled:
                # Once, as the map stays as it is: a second answer would be the same.
                goal_to_plan = GetPathGoal(goal_pose, planner=planner, dist_tolerance=tolerance, max_retries=0)
                result, refining = planned(server, goal_to_plan)
            seconds = wall_seconds() - began - compiled.seconds
            notes += [refining] if refining else []
            if png is not None:
                with waiting("drawing the picture"):
                    draw_plan(png, server, start_pose, goal_pose, result)
    if compiled.kernels:
        typer.echo(str(compiled), err=True)
    _report(result, seconds, notes, as_json, surveyed)
    if not result.success:
        raise typer.Exit(FAILURE)


def _require_planner(config: Config, name: str) -> None:
    """Refuse a name that no planner of the configuration has, before the map is built."""
    from mbf_abstract.plugins import PluginKind

    known = [plugin.name for plugin in config.plugins if plugin.kind is PluginKind.PLANNER]
    if name and name not in known:
        expected = f"one of {', '.join(known)}" if known else "none, as the configuration has no planners"
        raise typer.BadParameter(f"expected {expected}, got {name!r}", param_hint="--planner")


def _pose(
    name: str, place: Place, server: AbstractNavigationServer, notes: list[str], survey: Survey | None = None
) -> Pose:
    """Pose at a place; a note names which storey was taken where there are several, or that there is no ground."""
    from mbf_abstract.geometry import Pose

    if server.ground_is_level:
        place = place.on_flat_map()
    if survey is not None:
        z = None if place.z is None else place.z - survey.origin[2]
        place = Place(*survey.to_map(place.x, place.y), z, place.yaw)
        notes.append(f"the {name} is at ({place.x:.2f}, {place.y:.2f}) of the map")
    yaw = place.yaw or 0.0
    if abs(yaw) > 2.0 * math.pi:
        notes.append(f"the heading at the {name} is {yaw:g} rad, more than a turn: degrees are not meant")
    if place.z is not None:
        return Pose.planar(place.x, place.y, yaw, place.z, frame_id=server.config.parameters.global_frame)
    heights = server.ground_heights(place.x, place.y)
    if not heights:
        hint = "" if survey or server.survey is None else "; --survey takes coordinates of the survey"
        notes.append(f"there is no ground at the {name} ({place.x:.10g}, {place.y:.10g}); its z is taken as 0 m{hint}")
    if len(heights) > 1:
        others = ", ".join(f"{height:.2f}" for height in heights[1:])
        notes.append(f"the {name} is put on the ground at z = {heights[0]:.2f} m; there is more at {others} m: give Z")
    return server.ground_pose(place.x, place.y, yaw)


def _report(
    result: GetPathResult, seconds: float, notes: list[str], as_json: bool, survey: Survey | None = None
) -> None:
    """Print the result on stdout; what was found in the map on stderr, or as one more entry of the JSON object."""
    path = result.path
    facts: dict[str, Any] = {
        "outcome": int(result.outcome),
        "outcome_name": result.outcome_name,
        "message": result.message,
        "planner": result.planner,
        "cost": round(result.cost, 6) if path is not None else None,
        "length_m": round(path.length, 6) if path is not None else None,
        "time_s": round(seconds, 6),
    }
    if as_json:
        poses = [] if path is None else [[*_position(pose, survey), *pose.orientation] for pose in path]
        typer.echo(json.dumps({**facts, "notes": notes, "poses": poses}))
        return
    for note in notes:
        typer.echo(f"note: {note}", err=True)
    facts["poses"] = 0 if path is None else len(path)
    for key, value in facts.items():
        typer.echo(f"{key:13} {'-' if value is None else value}")


def _position(pose: Pose, survey: Survey | None) -> tuple[float, ...]:
    """Position [m] on the map, or in the coordinates of its survey."""
    return pose.position if survey is None else (*survey.from_map(pose.x, pose.y), pose.z + survey.origin[2])
