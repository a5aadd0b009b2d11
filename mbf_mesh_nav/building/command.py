"""The commands ``mbf map``; ``mbf map build``: a map to drive on from point clouds."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mbf_abstract.commands.reporting import readable_errors
from mbf_abstract.commands.waiting import waiting
from mbf_mesh_nav.tiles.command import tile

if TYPE_CHECKING:
    from mbf_mesh_nav.building.surface import SurfaceParameters

OPTIONS = {"decimation_bound": "--decimate"}
"""Options whose name is not that of the parameter."""


def register(app: typer.Typer) -> None:
    """Add the commands to the application ``mbf``."""
    maps = typer.Typer(help="Maps from what a survey measured.", no_args_is_help=True)
    maps.callback()(_group)
    maps.command("build")(build)
    maps.command("tile")(tile)
    app.add_typer(maps, name="map")


def _group() -> None:
    """Maps from what a survey measured."""


def build(
    inputs: list[Path] | None = typer.Argument(
        None, help="Point clouds (PLY, PCD, LAS, XYZ, OctoMap, ...), or meshes to sample."
    ),
    from_run: list[Path] = typer.Option(
        [], "--from-run", help="Folder of a run: what its range sensors hit. May be given several times."
    ),
    out: Path = typer.Option(..., "--out", help="The map, a .ply file; replaced when the new one is complete."),
    up: str = typer.Option("", "--up", help="Axis of the files that points up: x, y or z; else as they state, or z."),
    scale: float = typer.Option(
        0.0, "--scale", min=0.0, help="Length of the files' unit [m]; 0 = as they state, or 1."
    ),
    crs: str = typer.Option(
        "",
        "--crs",
        help="Coordinate system of the files: EPSG:25832, a PROJ string or well-known text; else as they state. "
        "Kept, not transformed.",
    ),
    cell: float = typer.Option(0.0, "--cell", min=0.0, help="Distance of the vertices [m]; 0 = by the density."),
    clearance: float = typer.Option(1.5, "--clearance", help="Free height that the robot needs [m]."),
    step_height: float = typer.Option(0.2, "--step-height", help="What is driven over, such as grass [m]."),
    hole_width: float = typer.Option(1.0, "--hole-width", help="Holes up to this width are filled [m]; 0 = none."),
    least_area: float = typer.Option(10.0, "--least-area", help="Smaller separate surfaces are left out [m²]."),
    decimate: float = typer.Option(
        0.0, "--decimate", help="Fewer vertices, whose faces stay this near to those of all [m]; 0 = all."
    ),
    max_points: int = typer.Option(50_000_000, "--max-points", min=1, help="More points are refused unread."),
    drop_invalid: bool = typer.Option(False, "--drop-invalid", help="Leave out points that are not finite."),
    report: Path | None = typer.Option(None, "--report", help="Also write this HTML file: pictures and a test plan."),
    as_json: bool = typer.Option(False, "--json", help="Print the figures as one JSON object."),
) -> None:
    """Build the surface that a robot may drive on, and print what was found, filled and left out.

    Ground, bridges and storeys become triangles. There are none where something stands or nothing was measured.
    """
    with readable_errors(out):
        from mbf_mesh_nav.building.map_build import build_map
        from mbf_mesh_nav.building.map_facts import lines_of
        from mbf_mesh_nav.building.report import refuse_report, write_report
        from mbf_mesh_nav.mesh.mesh_report import MeshError

        if up not in ("", "x", "y", "z"):
            raise typer.BadParameter(f"expected x, y or z, got {up!r}", param_hint="--up")
        if not scale < math.inf:
            raise typer.BadParameter(f"expected a finite length, got {scale}", param_hint="--scale")
        parameters = _surface_parameters(
            cell=cell,
            clearance=clearance,
            step_height=step_height,
            hole_width=hole_width,
            least_area=least_area,
            decimation_bound=decimate,
        )
        for folder in from_run:
            if not folder.is_dir():
                got = "expected the folder of a run, got a file" if folder.exists() else "there is no such folder"
                raise MeshError(str(folder), [got])
        if report is not None:
            refuse_report(report)
        files = [*(inputs or ()), *from_run]
        with waiting("reading") as say:
            facts, surface, cloud = build_map(
                files,
                out,
                parameters,
                up_axis=up,
                unit=scale,
                crs=crs,
                max_points=max_points,
                drop_invalid=drop_invalid,
                on_step=say,
            )
            if report is not None:
                say("planning between the farthest places")
                plan = write_report(report, files, out, facts, surface, cloud)
                notes = (*cloud.notes, f"test plan by {plan.text}")
            else:
                notes = cloud.notes
    if as_json:
        typer.echo(json.dumps({"map": str(out), **asdict(facts), "notes": notes}))
        return
    for note in notes:
        typer.echo(f"note: {note}", err=True)
    for name, text in lines_of(facts):
        typer.echo(f"{name:12} {text}")


def _surface_parameters(**values: float) -> SurfaceParameters:
    """Parameters of a surface; the option of the first value that is not legal is named."""
    from pydantic import ValidationError

    from mbf_abstract.config.mistakes import mistakes_of
    from mbf_mesh_nav.building.surface import SurfaceParameters

    try:
        return SurfaceParameters.model_validate(values)
    except ValidationError as error:
        wrong = mistakes_of(SurfaceParameters, values, error.errors(include_url=False))[0]
        name = str(wrong.loc[0])
        hint = OPTIONS.get(name, f"--{name.replace('_', '-')}")
        raise typer.BadParameter(f"expected {wrong.expected}, got {wrong.got}", param_hint=hint) from error
