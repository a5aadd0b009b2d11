"""The report of a built map: one HTML file with its figures, a picture of each step, and a test plan."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from pathlib import Path

from mbf_abstract.whole_files import write_whole
from mbf_mesh_nav.building.clouds.point_cloud import PointCloud
from mbf_mesh_nav.building.farthest_plan import FarthestPlan, plan_farthest
from mbf_mesh_nav.building.map_facts import MapFacts, lines_of
from mbf_mesh_nav.building.pictures import change_picture, density_picture, error_picture, height_picture, level_picture
from mbf_mesh_nav.building.surface import BuiltSurface
from mbf_mesh_nav.mesh.mesh_report import MeshError

PAGE = """\
<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1100px; margin: 2em auto; padding: 0 1em }}
td {{ padding: 0.15em 1em 0.15em 0; vertical-align: top }} td:first-child {{ color: #666 }}
td {{ overflow-wrap: anywhere }}
.pictures {{ display: grid; grid-template-columns: repeat(auto-fit, minmax(min(420px, 100%), 1fr)); gap: 1.5em }}
figure {{ margin: 0 }} img {{ width: 100%; border: 1px solid #ddd; image-rendering: pixelated }}
figcaption {{ color: #555; font-size: 13px }} .failed {{ color: #b00020 }}
</style></head><body>
<h1>{title}</h1>
<p>{inputs}</p>
<table>{figures}</table>
{notes}<h2>Test plan</h2>
<p{plan_class}>{plan}</p>
<h2>Steps</h2>
<div class="pictures">
{pictures}
</div>
</body></html>
"""
PAGE_ENDINGS = (".html", ".htm")


def refuse_report(file: Path) -> None:
    """Refuse a name for the report before anything is built.

    Raises
    ------
    MeshError
        It is not that of a page, or its folder is not there.
    """
    if file.suffix.lower() not in PAGE_ENDINGS:
        raise MeshError(str(file), [f"a report is written as {PAGE_ENDINGS[0]}, not as '{file.suffix}'"])
    if not file.parent.is_dir():
        raise MeshError(str(file), ["there is no such folder"])
    if file.is_dir():
        raise MeshError(str(file), ["expected a file, got a folder"])


def write_report(
    file: Path, inputs: Sequence[Path], out: Path, facts: MapFacts, surface: BuiltSurface, cloud: PointCloud
) -> FarthestPlan:
    """Plan between the farthest places of the map ``out`` and write the report; it opens without a network.

    Raises
    ------
    MeshError
        It cannot be written.
    """
    plan = plan_farthest(out)
    pictures = (
        ("1. Points", density_picture(surface)),
        ("2. Levels", level_picture(surface)),
        ("3. Holes, obstacles, what was left out", change_picture(surface)),
        ("4. Surface and test plan", height_picture(surface, plan.path if len(plan.path) else None)),
        ("5. Error", error_picture(surface)),
    )
    page = PAGE.format(
        title=html.escape(out.name),
        inputs=html.escape("From " + ", ".join(one.name for one in inputs)),
        figures="".join(f"<tr><td>{name}</td><td>{html.escape(text)}</td></tr>" for name, text in lines_of(facts)),
        notes="".join(f"<p>{html.escape(note)}</p>\n" for note in cloud.notes),
        plan=html.escape(_describe(plan)),
        plan_class="" if plan.success else ' class="failed"',
        pictures="\n".join(_figure(name, *picture) for name, picture in pictures),
    )
    try:
        write_whole(file, page)
    except OSError as error:
        raise MeshError(str(file), [f"cannot be written: {error.strerror or error}"]) from error
    return plan


def _describe(plan: FarthestPlan) -> str:
    start, goal = (", ".join(f"{value:.1f}" for value in place) for place in (plan.start, plan.goal))
    return (
        f"From ({start}) to ({goal}), the farthest places of the largest free part: {plan.text}. "
        f"{plan.free_share:.0%} of the vertices are free in the default layers of a bare mesh."
    )


def _figure(name: str, png: bytes, caption: str) -> str:
    picture = base64.b64encode(png).decode("ascii")
    return (
        f'<figure><h3>{name}</h3><img alt="{html.escape(caption)}" src="data:image/png;base64,{picture}">'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )
