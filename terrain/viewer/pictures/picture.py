"""A run from above: shaded ground, walls, what moved, plan, driven track, start and goals, as a PNG by matplotlib.

Use it for reports and READMEs; it takes about a second per hundred thousand triangles. For motion see
``terrain.viewer.replay``.
"""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose
from terrain.recording.joint_recording import JointRecording
from terrain.recording.recording import Recording, StampedPoints
from terrain.viewer.pictures.colours import ACTORS, DRIVEN, FLEET, GOAL, LEVELS, PLANNED, START, Colour, slope_legend
from terrain.viewer.pictures.shading import shaded_triangles
from terrain.viewer.pictures.shapes import standing_things

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LONG_SIDE = 9.0  # inches
DOTS_PER_INCH = 130
MAX_NAME = 60  # characters of a name in the title; the picture is as wide as its title
HALO = 1.6  # points of white around lines, so that they show on any ground


class ViewerMissing(Exception):
    """A package that draws is not installed; the text names the command that installs it."""


def picture_png(recording: Recording) -> bytes:
    """Draw a recording as the bytes of a PNG file; raises ViewerMissing without matplotlib."""
    figure, axes = new_figure(_extent(recording))
    _draw_world(axes, recording)
    _draw_actors(axes, recording)
    draw_paths(axes, recording.paths)
    _draw_track(axes, recording)
    draw_marks(axes, recording.start, recording.goals)
    _label(axes, recording)
    return png_bytes(figure)


def joint_picture_png(run: JointRecording) -> bytes:
    """Draw several robots of a run, each in a colour of its own; as ``picture_png``."""
    world = run.world
    figure, axes = new_figure(_extent(world))
    _draw_world(axes, world)
    _draw_actors(axes, world)
    for number, (name, recording) in enumerate(run.robots.items()):
        colour = FLEET[number % len(FLEET)]
        for _, points in recording.paths[-1:]:
            axes.plot(points[:, 0], points[:, 1], color=np.array(PLANNED) / 255.0, linewidth=1.0, alpha=0.35, zorder=4)
        _draw_track(axes, recording, colour, name)
        draw_marks(axes, recording.start, recording.goals, labelled=number == 0)
    _label(
        axes, world, f"{sum(_driven(robot) for robot in run.robots.values()):.1f} m driven by {len(run.robots)} robots"
    )
    return png_bytes(figure)


def new_figure(extent: tuple[float, float, float, float]) -> tuple[Figure, Axes]:
    """Make a figure of the extent's proportions, without a window and without matplotlib's global state."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ViewerMissing(f"pictures need matplotlib: pip install 'mbf-flex[sim]' ({error})") from error
    x_min, x_max, y_min, y_max = extent
    width, height = x_max - x_min, y_max - y_min
    scale = LONG_SIDE / max(width, height)
    figure = Figure(figsize=(max(width * scale, 4.0) + 1.0, max(height * scale, 3.0) + 1.6), dpi=DOTS_PER_INCH)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.set_facecolor("#e8e8e8")
    return figure, axes


def png_bytes(figure: Figure) -> bytes:
    """Return the figure as a PNG file, cut to its contents."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)  # drawn as a box
        figure.savefig(buffer, format="png", bbox_inches="tight", facecolor="white")
    return buffer.getvalue()


def _extent(recording: Recording) -> tuple[float, float, float, float]:
    """What must be in the picture: the world, or the track and the goals where there is none; with a margin."""
    surfaces = [surface.vertices[:, :2] for surface in (recording.ground, recording.walls) if surface is not None]
    poses = [recording.start, *recording.goals]
    points = np.concatenate([*surfaces, recording.poses[:, :2], [pose.position[:2] for pose in poses]])
    (x_min, y_min), (x_max, y_max) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    margin = 1.0 if not surfaces else 0.0
    return x_min - margin, x_max + margin, y_min - margin, y_max + margin


def _draw_world(axes: Axes, recording: Recording) -> None:
    if recording.ground is not None:
        draw_triangles(axes, *shaded_triangles(recording.ground))
    for name, surface, colour in standing_things(recording):
        corners, label = surface.vertices[surface.faces][:, :, :2], "on no map" if name == "obstacles" else None
        draw_triangles(axes, corners, np.tile(np.array(colour) / 255.0, (len(corners), 1)))
        axes.plot([], [], "s", color=np.array(colour) / 255.0, markersize=9, label=label)
    if recording.ground is not None and np.ptp(recording.ground.vertices[:, 2]) > 0.5:
        _draw_slope_legend(axes)


def draw_triangles(axes: Axes, corners: FloatArray, colours: FloatArray) -> None:
    """Paint triangles (n, 3, 2) in the given order, one colour (n, 3) each."""
    from matplotlib.collections import PolyCollection

    collection = PolyCollection(list(corners), facecolors=colours, edgecolors="none", antialiaseds=False, zorder=1)
    collection.set_rasterized(True)
    axes.add_collection(collection, autolim=False)


def _draw_slope_legend(axes: Axes) -> None:
    from matplotlib.patches import Patch

    handles = [Patch(color=np.array(colour) / 255.0, label=label) for label, colour in slope_legend()]
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.005, 1.0)}
    legend = axes.legend(handles=handles, title="slope", frameon=False, fontsize=8, title_fontsize=8, **place)
    axes.add_artist(legend)  # keeps it when the second legend is made, but clips it to the axes
    legend.set_clip_on(False)


def _line(axes: Axes, points: FloatArray, colour: tuple[int, int, int], width: float, **style: Any) -> None:
    from matplotlib.patheffects import Normal, Stroke

    effects = [Stroke(linewidth=width + HALO, foreground="white", alpha=0.7), Normal()]
    (line,) = axes.plot(points[:, 0], points[:, 1], color=np.array(colour) / 255.0, linewidth=width, **style)
    line.set_path_effects(effects)


def draw_paths(axes: Axes, paths: list[StampedPoints]) -> None:
    """Draw the last plan strong and those before it faint; wide, so that it shows beside the track upon it."""
    for _, points in paths[:-1]:
        axes.plot(points[:, 0], points[:, 1], color=np.array(PLANNED) / 255.0, linewidth=1.0, alpha=0.35, zorder=4)
    for _, points in paths[-1:]:
        _line(axes, points, PLANNED, 3.6, zorder=5, label="plan")


def _draw_actors(axes: Axes, recording: Recording) -> None:
    """Where people, doors and other robots have been, dotted, and where they were at the end."""
    labelled: set[str] = set()
    for track in recording.actors:
        if not len(track.poses):
            continue
        label = None if track.thing in labelled else track.thing
        labelled.add(track.thing)
        style: dict[str, Any] = {"color": np.array(ACTORS[track.thing]) / 255.0, "linestyle": ":", "zorder": 3}
        axes.plot(track.poses[:, 0], track.poses[:, 1], linewidth=1.5, **style)
        axes.plot(*track.poses[-1, :2], marker="o", markersize=6, label=label, **style)


def _draw_track(axes: Axes, recording: Recording, colour: Colour = DRIVEN, label: str = "driven track") -> None:
    draw_track(axes, recording.poses, recording.robot.footprint, colour, label)


def draw_track(
    axes: Axes, poses: FloatArray, footprint: FloatArray, colour: Colour = DRIVEN, label: str = "driven track"
) -> None:
    """Draw the track of poses (n, 7), and the footprint (m, 2) [m] at the last one; nothing without poses."""
    if len(poses):
        _line(axes, poses[:, :2], colour, 1.5, zorder=6, label=label)
        heading = Pose((0, 0, 0), tuple(poses[-1, 3:].tolist()))
        outline = footprint @ heading.rotation[:2, :2].T + poses[-1, :2]
        axes.fill(*outline.T, facecolor=np.array(colour) / 255.0, edgecolor="white", linewidth=0.8, zorder=8)


def draw_marks(axes: Axes, start: Pose, goals: tuple[Pose, ...], labelled: bool = True) -> None:
    """Mark the start by a disc and the goals by stars; ``labelled`` if the legend shall name them."""
    mark: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "white", "markeredgewidth": 1.2, "zorder": 9}
    axes.plot(
        start.x,
        start.y,
        marker="o",
        markersize=10,
        color=np.array(START) / 255.0,
        label="start" if labelled else None,
        **mark,
    )
    for index, goal in enumerate(goals):
        label = "goal" if index == 0 and labelled else None
        axes.plot(goal.x, goal.y, marker="*", markersize=18, color=np.array(GOAL) / 255.0, label=label, **mark)


def _driven(recording: Recording) -> float:
    """Length of the track [m]."""
    return float(np.linalg.norm(np.diff(recording.poses[:, :3], axis=0), axis=1).sum())


def _label(axes: Axes, recording: Recording, driven: str = "") -> None:
    title = f"{recording.scenario[:MAX_NAME]} · {recording.backend[:MAX_NAME]} · {recording.verdict.title}"
    tilt = np.degrees(recording.tilt).max(initial=0.0)
    facts = f"{driven or f'{_driven(recording):.1f} m driven'} in {recording.duration:.1f} s, tilt up to {tilt:.0f}°"
    colour = LEVELS[recording.verdict.level]
    axes.set_title(f"{title}\n", loc="left", fontsize=12, fontweight="bold", color=colour, parse_math=False)
    axes.text(0.0, 1.015, facts, transform=axes.transAxes, fontsize=9, color="#444444")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=6, frameon=False, fontsize=9)
