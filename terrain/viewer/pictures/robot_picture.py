"""The picture of ``mbf robot show --png``: a robot from above and from the side, with what navigation takes of it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from mbf_abstract.geometry import FloatArray
from mbf_abstract.whole_files import write_whole
from terrain.description.description import RobotDescription
from terrain.description.outline import as_array, convex_outline
from terrain.viewer.pictures.picture import new_figure, png_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BODY, WHEEL, OUTLINE, MASS, RAMP = "#b8c4d6", "#3c4654", "#c0392b", "#1a7f37", "#8a5a00"
MARGIN = 0.25  # of the robot's length, around it


def write_robot_picture(file: str | Path, robot: RobotDescription) -> None:
    """Draw a robot into a PNG file; raises ViewerMissing without matplotlib."""
    outline = as_array(robot.footprint)
    (x_min, y_min), (x_max, y_max) = outline.min(axis=0).tolist(), outline.max(axis=0).tolist()
    margin = MARGIN * (x_max - x_min)
    widths = (x_min - margin, x_max + margin)
    figure, _ = new_figure((*widths, y_min - margin, y_max + margin + robot.height + 2.0 * margin))
    figure.clear()
    heights = (y_max - y_min + 2.0 * margin, robot.height + 1.4 * margin)
    above, side = figure.subplots(2, 1, sharex=True, height_ratios=heights)
    for axes, label in ((above, "y [m]"), (side, "z [m]")):
        axes.set(aspect="equal", xlim=widths, ylabel=label)
    above.set(ylim=(y_min - margin, y_max + margin))
    side.set(ylim=(-0.4 * margin, robot.height + margin), xlabel="x [m]")
    for axes, upward in ((above, 1), (side, 2)):
        _draw_solids(axes, robot, upward)
        centre = robot.center_of_mass
        axes.plot(centre[0], centre[upward], "o", color=MASS, label="centre of mass", zorder=5)
    above.fill(outline[:, 0], outline[:, 1], fill=False, edgecolor=OUTLINE, linewidth=1.5, label="footprint")
    if len(robot.contacts):
        above.plot(robot.contacts[:, 0], robot.contacts[:, 1], "x", color=WHEEL, label="on the ground")
    side.axhline(0.0, color=WHEEL, linewidth=0.8)
    _draw_ramps(side, robot, widths)
    above.legend(loc="upper right", fontsize=8, frameon=False)
    above.set_title(_title(robot), loc="left", fontsize=10, parse_math=False)
    write_whole(file, png_bytes(figure))


def _title(robot: RobotDescription) -> str:
    text = f"{robot.urdf.name[:60]} · {robot.drive} · {robot.mass:.1f} kg"
    if robot.tipping is not None:
        text += f" · tips over at {math.degrees(robot.tipping.least):.0f} deg"
    return text


def _draw_solids(axes: Axes, robot: RobotDescription, upward: int) -> None:
    """Draw the hull of each shape as seen along y or z, lower ones first."""
    turning = {name for wheel in robot.gear.wheels for name in wheel.links}
    solids = robot.solids_by_link()
    for on_top in (False, True):
        for name, points in solids:
            if (name in turning) is on_top:
                corners = as_array(convex_outline(_seen(points, upward)))
                style = {"facecolor": WHEEL if on_top else BODY, "edgecolor": "white", "alpha": 0.8}
                axes.fill(corners[:, 0], corners[:, 1], **style, zorder=2 + on_top)


def _seen(points: FloatArray, upward: int) -> FloatArray:
    return points[:, [0, upward]]


def _draw_ramps(axes: Axes, robot: RobotDescription, widths: tuple[float, float]) -> None:
    """Draw the steepest ramps that the robot clears, tangent to its wheels."""
    if robot.edges is None:
        return
    places = sorted((float(part.centre[0] - robot.p_root_base[0]), part.radius) for part in robot.gear.standing)
    for (x, radius), angle, side, end in (
        (places[-1], robot.edges.approach, 1.0, widths[1]),
        (places[0], robot.edges.departure, -1.0, widths[0]),
    ):
        touch_x, touch_z = x + side * radius * math.sin(angle), radius - radius * math.cos(angle)
        length = min(abs(end - touch_x) / max(math.cos(angle), 1e-6), robot.height / max(math.sin(angle), 1e-6))
        rise = (touch_x + side * length * math.cos(angle), touch_z + length * math.sin(angle))
        axes.plot((touch_x, rise[0]), (touch_z, rise[1]), color=RAMP, linestyle="--", linewidth=1.0)
        axes.annotate(f"{math.degrees(angle):.0f} deg", rise, color=RAMP, fontsize=8)
