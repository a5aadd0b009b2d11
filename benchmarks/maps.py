"""Full circle: a cloud of a known world, the map built from it, a plan on the built map, the drive in the true world.

    python benchmarks/maps.py [--quick] [--json] [--workers 2] [--terrains 40] [--buildings 10] [--sizes 1,10]
                              [--levels 0,1,2] [--seed 7000] [--maps true,built,posed,coarse] [--log FILE]

Terrains are those of ``mbf bench outdoor`` of every level, with posts, on seeds that nothing was chosen on. Their
clouds have 100 points on a square metre with noise of 2 cm, crowns above the posts, and grass of 10 cm on a fifth of
the ground. Buildings are the shipped bridge and garage, scanned on all sides with the same density and noise. Each is
driven once on the built map and once on the true one, of which the faces below the posts are cut out. Terrains are
driven with the shipped ``outdoor_mesh.yaml``, whose fallback planner ``mbf bench`` leaves out. ``--maps`` adds worse
ones of the terrains: ``posed`` is built from scans whose poses are wrong (5 cm along each axis and 2 degrees of
heading, half of it drift that lasts for some twenty scans; a robot knows its roll and pitch from gravity), ``coarse``
is the built one with a quarter of the vertices and heights that are wrong by up to 3 cm. Rates are over the terrains
with a route (by the judge of ``mbf bench``, posts included). ``--log`` takes each finished terrain or building, and
a run with the same options goes on behind them. ``--sizes`` are millions of points, each built in a process of its own;
CPU time and peak memory are of that process.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.building.clouds.point_cloud import PointCloud
from mbf_mesh_nav.building.decimation import carried_errors, decimated_to
from mbf_mesh_nav.building.height_errors import root_mean_square
from mbf_mesh_nav.building.map_build import write_map
from mbf_mesh_nav.building.map_facts import map_facts
from mbf_mesh_nav.building.surface import BuiltSurface, build_surface
from mbf_mesh_nav.files.map_header import MapHeader
from mbf_mesh_nav.files.vertex_errors import VertexErrors
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from terrain.experiments.evaluation.outdoor import FROM_CORNER, LEVELS, SIZE, generated
from terrain.experiments.evaluation.reachability import is_reachable
from terrain.physics.robot_models import HUSKY
from terrain.scenarios.environment import FOREST_STREAM, WORLD_STREAM
from terrain.scenarios.library import LIBRARY
from terrain.scenarios.obstacles import Forest, Obstacle
from terrain.scenarios.places import coordinates
from terrain.scenarios.scenario import Scenario, load_scenario
from terrain.scenarios.world_types import GarageWorld
from terrain.sweeps.sweep import SweepRun, run_once
from terrain.sweeps.worker_pool import run_in_workers
from terrain.worlds.generate import fractal_terrain
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.surface import Surface

FloatArray = NDArray[np.float64]
DENSITY, NOISE, GRASS, GRASS_SHARE = 100.0, 0.02, 0.1, 0.2
FIRST_SEED, CLOUD_STREAM = 7000, 99
POSE_ERROR, HEADING_ERROR, DRIFT_SCANS = 0.05, np.radians(2.0), 20
SCAN_STEP, SCAN_REACH = 1.0, 4.0
COARSE_SHARE, COARSE_HEIGHTS = 0.25, 0.03
KINDS = ("true", "built", "posed", "coarse")
POSTS = Forest(x_range=(2.0, SIZE[0] - 2.0), y_range=(2.0, SIZE[1] - 2.0), count=12, gap=2.4, diameter=0.3, height=1.5)
MAP_FILE = "mesh_map.mesh_file"
NAVIGATION = {"mesh": LIBRARY / "config" / "outdoor_mesh.yaml"}
Row = dict[str, Any]


class World(NamedTuple):
    """A terrain by its level and seed with the maps of it, or a building by its number."""

    level: int
    seed: int
    kinds: tuple[str, ...]
    building: int = -1


class BuiltMap(NamedTuple):
    """A mesh, and the standard errors of its heights."""

    vertices: FloatArray
    faces: IntArray
    errors: VertexErrors


def scan_ground(ground: Heightfield, rng: np.random.Generator, grass_share: float) -> FloatArray:
    """Points on the ground, on a share of its squares of 4 m every other one on a blade of grass."""
    count = int(DENSITY * ground.size[0] * ground.size[1])
    corner = (ground.x0, ground.y0)
    x, y = rng.uniform(corner, np.add(corner, ground.size), (count, 2)).T
    square = (x // 4.0 * 7.0 + y // 4.0 * 13.0) % 10.0
    blade = np.where(
        (square < 10.0 * grass_share) & (rng.uniform(size=count) < 0.5), rng.uniform(0.0, GRASS, count), 0.0
    )
    return np.column_stack([x, y, ground.height_at(x, y) + blade + rng.normal(0.0, NOISE, count)])


def scan_post(post: Obstacle, foot: float, rng: np.random.Generator) -> FloatArray:
    """Points on the side of a post, and in a crown of 3 m from 2.5 m above the ground on."""
    radius, height = 0.5 * post.size[0], post.size[2]
    count = int(DENSITY * 2.0 * np.pi * radius * height)
    angle, up = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(0.0, height, count)
    side = np.column_stack([post.x + radius * np.cos(angle), post.y + radius * np.sin(angle), foot + up])
    directions = rng.normal(size=(800, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    reach = rng.uniform(0.3, 1.0, (800, 1)) * (1.5, 1.5, 1.2)
    return np.vstack([side + rng.normal(0.0, NOISE, side.shape), [post.x, post.y, foot + 3.7] + directions * reach])


def scan_surface(surface: Surface, rng: np.random.Generator) -> FloatArray:
    """Points evenly on all faces."""
    a, b, c = (np.asarray(surface.vertices, dtype=np.float64)[surface.faces[:, corner]] for corner in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    face = np.repeat(np.arange(len(areas)), rng.poisson(DENSITY * areas))
    u, v = np.sqrt(rng.uniform(size=(len(face), 1))), rng.uniform(size=(len(face), 1))
    points = a[face] * (1.0 - u) + b[face] * (u * (1.0 - v)) + c[face] * (u * v)
    return points + rng.normal(0.0, NOISE, points.shape)


def misplaced(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Points as a robot with wrong poses maps them, from scans on lanes across the ground.

    Each point is of a scan within reach, drawn at random, so that scans overlap. Half of the variance of an error is
    noise of its own, half is shared by neighbouring scans.
    """
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    columns, rows = np.ceil((high - low) / SCAN_STEP).astype(np.int64) + 1
    count = int(columns * rows)
    kept = np.exp(-1.0 / DRIFT_SCANS)
    drift = np.empty((count, 4))
    drift[0] = rng.normal(size=4)
    for number in range(1, count):
        drift[number] = kept * drift[number - 1] + np.sqrt(1.0 - kept * kept) * rng.normal(size=4)
    sizes = np.sqrt(0.5) * np.array([POSE_ERROR, POSE_ERROR, POSE_ERROR, HEADING_ERROR])
    errors = sizes * (drift + rng.normal(size=(count, 4)))
    seen_from = points[:, :2] + rng.uniform(-SCAN_REACH, SCAN_REACH, (len(points), 2))
    column, row = np.clip(np.rint((seen_from - low) / SCAN_STEP), 0, (columns - 1, rows - 1)).astype(np.int64).T
    scan = row * columns + np.where(row % 2 == 0, column, columns - 1 - column)  # there on one lane, back on the next
    arm = points[:, :2] - low - SCAN_STEP * np.column_stack([column, row])
    turn = errors[scan, 3]
    moved = np.column_stack([-turn * arm[:, 1], turn * arm[:, 0], np.zeros(len(points))])
    return points + errors[scan, :3] + moved


def coarser(built: BuiltMap, rng: np.random.Generator) -> BuiltMap:
    """A quarter of the vertices, with wrong heights; the error is what the vertices of the built map show."""
    mesh = decimated_to(built.vertices, built.faces, COARSE_SHARE)
    points = mesh.vertices + [0.0, 0.0, 1.0] * rng.uniform(-COARSE_HEIGHTS, COARSE_HEIGHTS, (len(mesh.vertices), 1))
    moved = replace(mesh, vertices=points)
    return BuiltMap(points, mesh.faces, carried_errors(moved, built.vertices, built.faces, built.errors))


def terrain_row(level: int, seed: int, folder: Path, kinds: Sequence[str] = KINDS[:2]) -> tuple[Scenario, Row]:
    """Build the maps of one terrain with posts; the scenario, and how the built one compares with the truth."""
    chosen = {"forests": (POSTS,), "limits": load_scenario("post_forest").limits, "navigation": NAVIGATION}
    scenario = generated(level).model_copy(update=chosen)
    clear = coordinates((scenario.start, *scenario.goals))
    ground = scenario.world.heightfield(np.random.default_rng([seed, WORLD_STREAM]), clear)  # type: ignore[union-attr]
    posts = POSTS.posts(np.random.default_rng([seed, FOREST_STREAM]), clear)
    places = np.array([[post.x, post.y] for post in posts])
    rng = np.random.default_rng([seed, CLOUD_STREAM])
    parts = [scan_ground(ground, rng, GRASS_SHARE)]
    parts += [scan_post(post, float(ground.height_at(post.x, post.y)), rng) for post in posts]
    points = np.vstack(parts)
    surface = build_surface(points)
    truth = heightfield_mesh(ground.heights, ground.dx, ground.dy, ground.x0, ground.y0)
    centres = truth[0][truth[1]].mean(axis=1)[:, :2]
    near = np.linalg.norm(centres[:, None] - places[None], axis=2).min(axis=1) < 0.3
    built = built_map(surface)
    exact = np.zeros(len(truth[0]))
    meshes = {"true": BuiltMap(truth[0], truth[1][~near], VertexErrors(exact, exact)), "built": built}
    if "posed" in kinds:
        scans = misplaced(points, rng)
        meshes["posed"] = built_map(build_surface(scans))
    if "coarse" in kinds:
        meshes["coarse"] = coarser(built, rng)
    maps = write_maps(folder, f"level_{level}_{seed}", {kind: meshes[kind] for kind in kinds})
    row = {"world": scenario.name, "seed": seed, "maps": maps, **accuracy(surface, ground, rng)}
    on_map = MeshMap.from_arrays(surface.vertices, surface.faces).locator
    above = np.column_stack([places, np.full(len(places), 100.0)])
    hit, lengths = on_map.cast_rays(above, np.tile([0.0, 0.0, -1.0], (len(places), 1)))
    height = 100.0 - lengths - ground.height_at(*places.T)
    row["posts"], row["posts_missed"] = len(posts), int(((hit >= 0) & (np.abs(height) < 1.0)).sum())
    row["route"] = has_route(scenario, ground, places)
    return scenario, row


def has_route(scenario: Scenario, ground: Heightfield, posts: FloatArray) -> bool:
    """Whether the judge finds a route with the posts as pillars of the ground."""
    x, y = np.meshgrid(ground.x0 + ground.dx * np.arange(ground.nx), ground.y0 + ground.dy * np.arange(ground.ny))
    near = np.hypot(x[..., None] - posts[:, 0], y[..., None] - posts[:, 1]).min(axis=-1) < 0.2
    with_posts = ground.with_heights(ground.heights + np.where(near, 1.5, 0.0))
    start, goal = scenario.start, scenario.goals[0]
    return is_reachable(with_posts, HUSKY, (start.x, start.y, start.yaw), (goal.x, goal.y))  # type: ignore[union-attr]


def accuracy(surface: BuiltSurface, ground: Heightfield, rng: np.random.Generator) -> Row:
    """Root mean square of the height of the built surface above the true ground, at random places."""
    low = np.array([ground.x0, ground.y0])
    x, y = rng.uniform(low + FROM_CORNER, low + np.subtract(ground.size, FROM_CORNER), (4000, 2)).T
    bare = (x // 4.0 * 7.0 + y // 4.0 * 13.0) % 10.0 >= 10.0 * GRASS_SHARE
    above = np.column_stack([x, y, ground.height_at(x, y) + 1.0])
    locator = MeshMap.from_arrays(surface.vertices, surface.faces).locator
    face, length = locator.cast_rays(above, np.tile([0.0, 0.0, -1.0], (len(above), 1)))
    error = 1.0 - length
    found = face >= 0
    return {
        "rms_bare_m": float(np.sqrt(np.mean(error[found & bare] ** 2))),
        "rms_grass_m": float(np.sqrt(np.mean(error[found & ~bare] ** 2))),
        "covered": float(found.mean()),
    }


def building_row(number: int, folder: Path) -> tuple[Scenario, Row]:
    """Build the map of the bridge, or of a garage of two to six floors."""
    seed = FIRST_SEED + number
    scenario = load_scenario("bridge" if number % 2 == 0 else "garage_roof")
    if number % 2:
        world = GarageWorld(type="garage", floors=2 + number // 2)
        time_limit = scenario.time_limit * max(1.0, world.floors / scenario.world.floors)  # type: ignore[union-attr]
        scenario = scenario.model_copy(update={"world": world, "time_limit": time_limit})
    levels = scenario.world.levels()  # type: ignore[union-attr]
    rng = np.random.default_rng([seed, CLOUD_STREAM])
    points = np.vstack([scan_surface(levels.ground, rng), scan_surface(levels.walls, rng)])
    built = built_map(build_surface(points))
    maps = write_maps(folder, f"{scenario.name}_{number}", {"built": built})
    # The world writes the true map itself, so no setting names a file.
    return scenario, {"world": scenario.name, "seed": seed, "maps": {"true": "", **maps}, "route": True}


def built_map(surface: BuiltSurface) -> BuiltMap:
    """The map of a surface, with the errors that ``mbf map build`` writes."""
    return BuiltMap(surface.vertices, surface.faces, VertexErrors(surface.height_errors, surface.place_errors))


def write_maps(folder: Path, name: str, maps: Mapping[str, BuiltMap]) -> dict[str, str]:
    """Write maps by their kinds; their files."""
    files = {}
    for kind, built in maps.items():
        files[kind] = str(folder / f"{name}_{kind}.ply")
        header = MapHeader((0.0, 0.0, 0.0), 0.0, 0.0, root_mean_square(built.errors.of_vertices))
        write_map(Path(files[kind]), built.vertices, built.faces, header, built.errors)
    return files


def drives(world: World) -> list[Row]:
    """Build the maps of a world and drive it once on each; one row each."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if world.building >= 0:
            scenario, row = building_row(world.building, folder)
        else:
            scenario, row = terrain_row(world.level, world.seed, folder, world.kinds)
        for kind, file in row.pop("maps").items():
            metrics = run_once((scenario, SweepRun(row["seed"], {MAP_FILE: file} if file else {})))
            answer = {"arrived": metrics["success"], "incidents": sorted(metrics.get("incidents", {}))}
            rows.append({**row, "map": kind, **answer, "outcome": metrics["outcome"], "message": metrics["message"]})
    return rows


def drive(worlds: Sequence[World], workers: int, log: Path | None) -> list[Row]:
    """Rows of all worlds; those in the log are not driven again."""
    lines = log.read_text().splitlines() if log is not None and log.is_file() else []
    known = {
        World(**{**line["world"], "kinds": tuple(line["world"]["kinds"])}): line["rows"]
        for line in map(json.loads, lines)
    }
    rows = [row for world in worlds for row in known.get(world, ())]
    for world, found in run_in_workers(drives, [world for world in worlds if world not in known], workers):
        rows += found
        if log is not None:
            with log.open("a") as stream:
                stream.write(json.dumps({"world": world._asdict(), "rows": found}) + "\n")
        for row in found:
            answer = (row["world"], row["seed"], row["map"], "route" if row["route"] else "no route", row["outcome"])
            print(" | ".join(map(str, (*answer, ",".join(row["incidents"]), row["message"]))), flush=True)
    return rows


def summarise(rows: list[Row]) -> Row:
    """Arrival on both maps where there is a route, and the accuracy of the built ones."""
    figures: Row = {}
    for kind in dict.fromkeys(row["map"] for row in rows):
        routed = [row for row in rows if row["map"] == kind and row["route"]]
        arrived = sum(bool(row["arrived"]) for row in routed)
        tipped = sum("tipped_over" in row["incidents"] for row in routed)
        hit = sum("collision" in row["incidents"] for row in routed)
        figures[kind] = {"with_route": len(routed), "arrived": arrived, "tipped_over": tipped, "collided": hit}
    built = [row for row in rows if row["map"] == "built" and "rms_bare_m" in row]
    for name in ("rms_bare_m", "rms_grass_m", "covered"):
        if built:
            values = [row[name] for row in built]
            figures[name] = {"mean": float(np.mean(values)), "min": min(values), "max": max(values)}
    figures["posts"] = sum(row["posts"] for row in built)
    figures["posts_missed"] = sum(row["posts_missed"] for row in built)
    return figures


def build_of_size(millions: float) -> Row:
    """Build a cloud of so many points in this process: CPU and wall time [s], peak memory [MB], error."""
    side = float(np.sqrt(1e6 * millions / DENSITY))
    rng = np.random.default_rng(1)
    ground = fractal_terrain(side, side, 0.5, rng, median_slope=10.0)
    build_surface(scan_ground(ground.crop(0.0, 20.0, 0.0, 20.0), rng, 0.0))  # the kernels are compiled
    points = scan_ground(ground, rng, 0.0)
    before, wall = time.process_time(), time.perf_counter()
    surface = build_surface(points)
    cpu, wall = time.process_time() - before, time.perf_counter() - wall
    facts = map_facts(PointCloud(points), surface)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    figures = {"points": len(points), "cpu_s": cpu, "wall_s": wall, "peak_mb": memory, "faces": facts.faces}
    return {**figures, **accuracy(surface, ground, rng)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="four terrains, one building, one million points")
    parser.add_argument("--json", action="store_true", help="print the figures as last line")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--terrains", type=int, default=40)
    parser.add_argument("--buildings", type=int, default=10)
    parser.add_argument("--sizes", default="1,10", help="millions of points, comma separated; empty = none")
    parser.add_argument("--levels", default=",".join(map(str, range(LEVELS))), help="of the terrains")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="of the first terrain of each level")
    parser.add_argument("--maps", default="true,built", help=f"of the terrains, some of {', '.join(KINDS)}")
    parser.add_argument("--log", type=Path, help="file that keeps each finished world, one JSON object a line")
    parser.add_argument("--one-size", type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one_size:
        print(json.dumps(build_of_size(arguments.one_size)))
        return
    terrains, buildings, sizes = arguments.terrains, arguments.buildings, arguments.sizes
    if arguments.quick:
        terrains, buildings, sizes = 4, 1, "1"
    levels, kinds = [int(level) for level in arguments.levels.split(",")], arguments.maps.split(",")
    figures: Row = {"sizes": []}
    for size in filter(None, sizes.split(",")):
        command = [sys.executable, __file__, "--one-size", size]
        answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        figures["sizes"].append(json.loads(answer.splitlines()[-1]))
        print(figures["sizes"][-1], flush=True)
    grounds = [World(levels[n % len(levels)], arguments.seed + n // len(levels), tuple(kinds)) for n in range(terrains)]
    figures["terrains"] = summarise(drive(grounds, arguments.workers, arguments.log))
    sites = [World(0, 0, (), n) for n in range(buildings)]
    figures["buildings"] = summarise(drive(sites, arguments.workers, arguments.log))
    for name, line in figures.items():
        print(f"{name:10} {line}")
    if arguments.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    with interruptible():
        main()
