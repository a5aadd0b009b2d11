"""A run from above, as a PNG by matplotlib: ground, walls, what moved, plans, driven tracks, start, goals, incidents.

A world of several storeys has a panel for each of them. Where the route takes only a small part of the world, the
picture shows the route, and an inset where in the world it is. Plans are wide and dashed, tracks narrow and solid, so
that no colour is needed to distinguish them.

Use it for reports and READMEs; it takes about a second. For motion see
``terrain.viewer.replay``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import FloatArray
from terrain.recording.joint_recording import JointRecording
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import ACTORS, DRIVEN, FLEET, LEVELS, PLANNED, Colour, slope_legend
from terrain.viewer.pictures.incident_marks import mark_of
from terrain.viewer.pictures.picture import (
    Extent,
    draw_marks,
    draw_paths,
    draw_scale_bar,
    draw_track,
    draw_triangles,
    panel_figure,
    pixel_size,
    png_bytes,
)
from terrain.viewer.pictures.shading import plain_triangles, shaded_triangles
from terrain.viewer.pictures.shapes import standing_things
from terrain.viewer.pictures.storeys import Panel, panels_of, storeys
from terrain.viewer.replay.world_mesh import coarse_faces
from terrain.worlds.surface import Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAX_NAME = 60  # characters of a name in the title; the picture is as wide as its title
SMALL_ROUTE = 0.3  # of the world's area; a route whose box is smaller is shown larger, with an inset of the world
MARGIN = 0.15  # of the route's length, around it
LEAST_SIDE = 0.5  # of the longer side of the route's box
INSET_CELLS = 150  # along the longer side of an inset's world
EDGE_WIDTH = 0.8  # pixels of the edges of what stands
DASHES = (0, (3.0, 1.4))
LEGEND_LENGTH = 3.4  # of a line in the legend, in letters: three dashes of a plan
LEAST_TILT = 1.0  # degrees; on floors there is nothing to say
INCIDENT_COLOUR = "#b00020"


def picture_png(recording: Recording) -> bytes:
    """Draw a recording as the bytes of a PNG file; raises ViewerMissing without matplotlib."""
    return _drawn(recording, {"": recording}, f"{_driven(recording):.1f} m driven")


def joint_picture_png(run: JointRecording) -> bytes:
    """Draw several robots of a run, each in a colour of its own; as ``picture_png``."""
    driven = sum(_driven(robot) for robot in run.robots.values())
    return _drawn(run.world, run.robots, f"{driven:.1f} m driven by {len(run.robots)} robots")


def _drawn(world: Recording, robots: Mapping[str, Recording], driven: str) -> bytes:
    whole = _extent(world)
    floors = storeys(world.ground)
    shown = whole if floors else _route_extent(world, whole)
    figure, axes = panel_figure(shown, max(len(floors), 1))
    panels = list(panels_of(axes, floors))
    colours = [FLEET[number % len(FLEET)] if name else DRIVEN for number, name in enumerate(robots)]
    for panel in panels:
        _draw_world(panel, world)
        _draw_actors(panel, world)
        for (name, recording), colour in zip(robots.items(), colours, strict=True):
            _draw_robot(panel, name, colour, recording)
        _draw_incidents(panel, world)
        draw_scale_bar(panel.axes)
        panel.axes.set(xlim=shown[:2], ylim=shown[2:])
        if floors:
            _caption(panel, floors.index(panel.floor))
    if shown != whole:
        _draw_inset(axes[0], world, zip(robots.values(), colours, strict=True), whole, shown)
    _label(axes, world, driven)
    return png_bytes(figure)


def _extent(recording: Recording) -> Extent:
    """What must be in the picture: the world, or the track and the goals where there is none; with a margin."""
    surfaces = [surface.vertices[:, :2] for surface in (recording.ground, recording.walls) if surface is not None]
    points = np.concatenate([*surfaces, _route(recording)])
    (x_min, y_min), (x_max, y_max) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    margin = 1.0 if not surfaces else 0.0
    return x_min - margin, x_max + margin, y_min - margin, y_max + margin


def _route(recording: Recording) -> FloatArray:
    """Track, start and goals, seen from above (n, 2) [m]."""
    ends = np.array([pose.position[:2] for pose in (recording.start, *recording.goals)])
    return np.concatenate([recording.poses[:, :2], ends])


def _route_extent(recording: Recording, whole: Extent) -> Extent:
    """The box around the route, not too narrow, within the whole; the whole where that is not much larger."""
    points = _route(recording)
    lower, upper = points.min(axis=0), points.max(axis=0)
    sides = upper - lower
    grow = np.maximum(LEAST_SIDE * sides.max() - sides, 0.0) / 2.0 + MARGIN * sides.max() + 1.0
    low, high = np.maximum(lower - grow, [whole[0], whole[2]]), np.minimum(upper + grow, [whole[1], whole[3]])
    area, of_whole = np.prod(high - low), (whole[1] - whole[0]) * (whole[3] - whole[2])
    return (low[0], high[0], low[1], high[1]) if area < SMALL_ROUTE * of_whole else whole


def _draw_world(panel: Panel, recording: Recording) -> None:
    painted, ground, edge = [], recording.ground, EDGE_WIDTH * pixel_size(panel.axes)
    if ground is not None:
        heights = ground.vertices[ground.faces, 2].mean(axis=1)
        painted.append(shaded_triangles(Surface(ground.vertices, ground.faces[heights < panel.cut])))
    for name, surface, colour in standing_things(recording):
        lows, highs = _solid_bounds(surface)
        faces = surface.faces[(highs > panel.floor + 0.1) & (lows < panel.cut)]
        label = "on no map" if name == "obstacles" else None
        painted.append(plain_triangles(Surface(surface.vertices, faces), colour, edge))
        panel.axes.plot([], [], "s", color=np.array(colour) / 255.0, markersize=9, label=label)
    _paint(panel.axes, painted)


def _solid_bounds(surface: Surface) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest z (F,), (F,) [m] of the solid that each face is a part of: of what is connected by edges."""
    a, b, c = surface.faces.T
    count = len(surface.vertices)
    edges = coo_array((np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, c]))), shape=(count, count))
    solids, solid = connected_components(edges, directed=False)
    lows, highs = np.full(solids, np.inf), np.full(solids, -np.inf)
    np.minimum.at(lows, solid, surface.vertices[:, 2])
    np.maximum.at(highs, solid, surface.vertices[:, 2])
    return lows[solid[a]], highs[solid[a]]


def _paint(axes: Axes, things: list[tuple[FloatArray, FloatArray]]) -> None:
    """Paint the triangles of all things, each over those before it."""
    if things:
        corners, colours = zip(*things, strict=True)
        draw_triangles(axes, np.concatenate(corners), np.concatenate(colours))


def _draw_actors(panel: Panel, recording: Recording) -> None:
    """Where people, doors and other robots have been, dotted, and where they were at the end."""
    for track in recording.actors:
        if not len(track.poses):
            continue
        points = panel.part(track.poses[:, :3])
        style: dict[str, Any] = {"color": np.array(ACTORS[track.thing]) / 255.0, "linestyle": ":", "zorder": 3}
        panel.axes.plot(points[:, 0], points[:, 1], linewidth=1.5, **style)
        panel.axes.plot(*points[-1, :2], marker="o", markersize=6, label=track.thing, **style)


def _draw_robot(panel: Panel, name: str, colour: Colour, recording: Recording) -> None:
    """Plans, track, start and goals of a robot; earlier plans faint."""
    axes, paths = panel.axes, [panel.part(points) for _, points in recording.paths]
    draw_paths(axes, paths, colour if name else PLANNED, f"{name}: " if name else "", DASHES)
    label = f"{name}: driven track" if name else "driven track"
    poses = np.concatenate([panel.part(recording.poses[:, :3]), recording.poses[:, 3:]], axis=1)
    draw_track(axes, poses, recording.robot.footprint, colour, label)
    goals = tuple(goal for goal in recording.goals if panel.shows(np.array([goal.position[2]]))[0])
    start = recording.start if panel.shows(np.array([recording.start.position[2]]))[0] else None
    draw_marks(axes, start, goals)


def _draw_incidents(panel: Panel, recording: Recording) -> None:
    for event in recording.events:
        if event.kind is not EventKind.INCIDENT or not panel.shows(np.array([event.data["z"]]))[0]:
            continue
        mark = mark_of(str(event.data["what"]))
        style: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "white", "markersize": 8, "zorder": 9}
        place = np.array([event.data["x"], event.data["y"]], dtype=np.float64).tolist()
        panel.axes.plot(*place, marker=mark.marker, color=INCIDENT_COLOUR, label=mark.label, **style)


def _caption(panel: Panel, number: int) -> None:
    back = {"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 3.0}
    text = f"storey {number}, z = {panel.floor:.1f} m"
    panel.axes.text(0.02, 0.97, text, transform=panel.axes.transAxes, va="top", fontsize=9, bbox=back, zorder=12)


def _draw_inset(
    axes: Axes, recording: Recording, robots: Iterable[tuple[Recording, Colour]], whole: Extent, shown: Extent
) -> None:
    """Beside the picture: all of the world, coarsely, with the frame of what the picture shows and the tracks."""
    inset = axes.inset_axes((1.02, 0.0, 0.3, 0.3))
    inset.set(xlim=whole[:2], ylim=whole[2:], aspect="equal", anchor="SW", xticks=[], yticks=[])
    painted, ground = [], recording.ground
    if ground is not None:
        cell = max(whole[1] - whole[0], whole[3] - whole[2]) / INSET_CELLS
        faces = coarse_faces(ground, np.zeros(len(ground.vertices), np.uint8), cell).astype(np.int32)
        painted.append(shaded_triangles(Surface(ground.vertices, faces)))
    edge = EDGE_WIDTH * pixel_size(inset)
    painted += [plain_triangles(surface, colour, edge) for _, surface, colour in standing_things(recording)]
    _paint(inset, painted)
    for robot, colour in robots:
        inset.plot(robot.poses[:, 0], robot.poses[:, 1], color=np.array(colour) / 255.0, linewidth=1.0)
    x_min, x_max, y_min, y_max = shown
    x, y = [x_min, x_max, x_max, x_min, x_min], [y_min, y_min, y_max, y_max, y_min]
    inset.plot(x, y, color="#222222", linewidth=1.2)


def _driven(recording: Recording) -> float:
    """Length of the track [m]."""
    return float(np.linalg.norm(np.diff(recording.poses[:, :3], axis=0), axis=1).sum())


def _label(axes: list[Axes], recording: Recording, driven: str) -> None:
    """Title, facts, and one legend for all panels."""
    figure, first = axes[0].figure, axes[0]
    title = f"{recording.scenario[:MAX_NAME]} · {recording.backend[:MAX_NAME]} · {recording.verdict.title}"
    tilt = np.degrees(recording.tilt).max(initial=0.0)
    facts = f"{driven} in {recording.duration:.1f} s" + (f", tilt up to {tilt:.0f}°" if tilt >= LEAST_TILT else "")
    colour = LEVELS[recording.verdict.level]
    first.set_title(f"{title}\n", loc="left", fontsize=12, fontweight="bold", color=colour, parse_math=False)
    above: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
    first.annotate(facts, (0.0, 1.0), (0.0, 6.0), fontsize=9, color="#444444", **above)
    if recording.ground is not None and np.ptp(recording.ground.vertices[:, 2]) > 0.5:
        _draw_slope_legend(axes[min(1, len(axes) - 1)])
    named: dict[str, Any] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    style: dict[str, Any] = {"ncols": 6, "frameon": False, "fontsize": 9, "handlelength": LEGEND_LENGTH}
    if len(axes) > 1:
        figure.legend(named.values(), named, loc="outside lower center", **style)
    else:
        first.legend(named.values(), named, loc="upper center", bbox_to_anchor=(0.5, -0.08), **style)


def _draw_slope_legend(axes: Axes) -> None:
    from matplotlib.patches import Patch

    handles = [Patch(color=np.array(colour) / 255.0, label=label) for label, colour in slope_legend()]
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.005, 1.0)}
    legend = axes.legend(handles=handles, title="slope", frameon=False, fontsize=8, title_fontsize=8, **place)
    axes.add_artist(legend)  # keeps it when the second legend is made, but clips it to the axes
    legend.set_clip_on(False)
