"""Makes docs/pictures/full_circle.png: a drive with a lidar, the map built from its scans, a drive planned on that map.

``python docs/make_full_circle.py`` takes about a minute. The first robot knows the ground and none of the trees. The
second one has no sensor: what keeps it off the trees is the map that the first one's scans were built into.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from mbf_mesh_nav.building.map_build import build_map
from mbf_mesh_nav.building.surface import BuiltSurface, SurfaceParameters
from terrain.recording.recording import Recording
from terrain.scenarios.library import LIBRARY
from terrain.scenarios.obstacles import Forest
from terrain.scenarios.scenario import PlanarPose, Scenario, load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.viewer.pictures.colours import DRIVEN, OBSTACLE, PLANNED
from terrain.viewer.pictures.picture import draw_line, draw_marks, draw_scale_bar, draw_track, draw_triangles
from terrain.viewer.pictures.shading import shaded_triangles
from terrain.worlds.surface import Surface

PICTURE = Path(__file__).resolve().parent / "pictures" / "full_circle.png"
SIZE, SEED = (30.0, 20.0), 7
TREES = Forest(x_range=(3.0, 27.0), y_range=(2.0, 18.0), count=32, gap=2.6, height=2.5)
ROUND_TRIP = ((26.0, 4.0), (26.0, 16.0), (4.0, 16.0), (4.0, 10.0), (26.0, 10.0))
WIDTH, HEIGHT_SHARE, COLOURS = 1300, 0.255, 128  # pixels, and of the file
POINTS_SHOWN = 40_000


def survey() -> Scenario:
    """A round trip with a 16-ring lidar of 2 cm noise, through trees that no map shows; the pose is noisy."""
    forest = load_scenario("post_forest")
    assert forest.world is not None
    world = forest.world.model_copy(update={"size": SIZE, "median_slope": 5.0})
    lidar = forest.sensors[0].model_copy(update={"max_range": 12.0, "noise": 0.02, "rays": 360, "rate": 10.0})
    changes = {"name": "survey", "world": world, "forests": (TREES,), "sensors": (lidar,), "time_limit": 600.0}
    changes["start"] = PlanarPose(x=4.0, y=4.0)
    changes["goals"] = tuple(PlanarPose(x=x, y=y) for x, y in ROUND_TRIP)
    changes["localization"] = load_scenario("outdoor").localization
    return forest.model_copy(update=changes)


def crossing(surveyed: Scenario) -> Scenario:
    """From corner to corner of the same world without a sensor."""
    navigation = {"mesh": LIBRARY / "config" / "outdoor_graph_mesh.yaml"}
    ends = {"start": PlanarPose(x=2.5, y=17.5, yaw=-0.5), "goals": (PlanarPose(x=27.5, y=2.5),)}
    return surveyed.model_copy(update={"name": "crossing", "sensors": (), "navigation": navigation, **ends})


def drive(scenario: Scenario, folder: Path, mesh_file: Path | None = None) -> Recording:
    """Run a scenario, on another map if there is one, and return what was recorded."""
    settings = {} if mesh_file is None else {"mesh_map.mesh_file": str(mesh_file)}
    result = run_scenario(scenario, RunOptions(folder, seed=SEED, settings=settings))
    if not result.success:
        raise SystemExit(f"{scenario.name}: {result.verdict}")
    return Recording.load(folder / "recording.npz")


def draw_survey(axes: Axes, recording: Recording) -> None:
    """What the lidar hit, by height above the lowest ground, and where the robot drove."""
    points = np.concatenate([points for _, points in recording.scans])
    order = np.argsort(points[:, 2], kind="stable")[:: max(1, len(points) // POINTS_SHOWN)]
    axes.scatter(
        points[order, 0], points[order, 1], c=points[order, 2], s=1.2, cmap="viridis", linewidths=0, rasterized=True
    )
    draw_track(axes, recording.poses, recording.robot.footprint)
    axes.set_title(f"1. A drive with a lidar: {len(points):,} points recorded", loc="left", fontsize=9)


def draw_built(axes: Axes, surface: BuiltSurface, plan: Recording) -> None:
    """The built map, what stands on it, and the plan."""
    draw_triangles(axes, *shaded_triangles(Surface(surface.vertices, surface.faces)))
    places = surface.patches.centres[surface.is_obstacle]
    axes.plot(*places.T, "s", color=np.array(OBSTACLE) / 255.0, markersize=2.0)
    draw_line(axes, plan.paths[-1][1], PLANNED, 2.0, zorder=5)
    draw_marks(axes, plan.start, plan.goals)
    axes.set_title(
        f"2. The map built from them, {len(surface.vertices):,} vertices, and a plan", loc="left", fontsize=9
    )


def draw_crossing(axes: Axes, recording: Recording) -> None:
    """The true world, its trees, and where the second robot drove."""
    assert recording.ground is not None and recording.obstacles is not None
    draw_triangles(axes, *shaded_triangles(recording.ground))
    corners = recording.obstacles.vertices[recording.obstacles.faces][:, :, :2]
    draw_triangles(axes, corners, np.tile(np.array(OBSTACLE) / 255.0, (len(corners), 1)))
    draw_track(axes, recording.poses, recording.robot.footprint, DRIVEN)
    draw_marks(axes, recording.start, recording.goals)
    axes.set_title("3. The drive through the true world, without a sensor", loc="left", fontsize=9)


def draw(first: Recording, surface: BuiltSurface, second: Recording) -> None:
    """Draw the three panels into the file."""
    figure = Figure((WIDTH / 100.0, WIDTH / 100.0 * HEIGHT_SHARE), dpi=100, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    panels = [figure.add_subplot(1, 3, number + 1) for number in range(3)]
    for axes in panels:
        axes.set(xlim=(0.0, SIZE[0]), ylim=(0.0, SIZE[1]), aspect="equal", xticks=[], yticks=[])
        axes.set_facecolor("#e8e8e8")
    draw_survey(panels[0], first)
    draw_built(panels[1], surface, second)
    draw_crossing(panels[2], second)
    draw_scale_bar(panels[2])
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.quantize(COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(PICTURE, optimize=True)


def main() -> None:
    """Drive, build, drive again, draw."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        surveyed = survey()
        first = drive(surveyed, home / "survey")
        _, surface, _ = build_map([home / "survey"], home / "map.ply", SurfaceParameters(hole_width=4.0))
        draw(first, surface, drive(crossing(surveyed), home / "crossing", home / "map.ply"))


if __name__ == "__main__":
    main()
