"""The outdoor evaluation on tiles: the same ground, robot, layers and controller on one mesh and on a folder of tiles.

    python benchmarks/outdoor_tiles.py [--levels 0:10] [--seeds 8000:8005] [--tile-size 8] [--results FILE] [--json]

On the mesh it is the default entry of ``mbf bench outdoor`` with its heading-aware fallback planner. On tiles it is
``tiles.hierarchical`` with the same refiner, which has no fallback. Terrains without a route for anybody are left out.
Finished runs stand in ``--results`` and are not run again.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import yaml
from rich.console import Console
from rich.table import Table

from mbf_abstract.config.configuration import Config
from mbf_abstract.time.program_end import interruptible
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.tiles.building.build import TileSettings, build_tiles
from mbf_mesh_nav.tiles.building.sources import HeightSource
from terrain.experiments.evaluation.entrant import configuration_of
from terrain.experiments.evaluation.outdoor import CONFIGS, generated, has_route, outdoor
from terrain.scenarios.environment import WORLD_STREAM
from terrain.scenarios.places import coordinates
from terrain.scenarios.scenario import Scenario
from terrain.sweeps.log import SweepLog
from terrain.sweeps.sweep import SweepRun, run_once

MAPS = ("mesh", "tiles")
ENTRY = "astar"
WINDOW = 24.0
"""Side [m] of the map around the robot that the controller drives on."""
HEIGHT_LIMIT = {"mesh_map.height_diff.height_limit": "1.0"}  # m; a tile has to state how far its layers look
FALLBACK = {"fallback_planner": "heading_astar"}
OF_ONE_MESH = ("backend", "planners", "heading_astar", "mesh_map")

Row = dict[str, Any]


def cut(scenario: Scenario, seed: int, config: Config, tile_size: float, folder: Path) -> None:
    """Write the very ground that a run with this seed drives on as tiles, with the layers of a mesh configuration."""
    clear = coordinates((scenario.start, *scenario.goals))
    ground = scenario.world.heightfield(np.random.default_rng([seed, WORLD_STREAM]), clear)  # type: ignore[union-attr]
    section = config.sections["mesh_map"]
    settings = TileSettings(
        mesh_map=cast(MeshMapParameters, section.parameters),
        layer_blocks={layer.name: layer.parameters for layer in section.layers},
        tile_size=tile_size,
        portal_length=tile_size / 8.0,
    )
    build_tiles(HeightSource(ground.heights, ground.dx, ground.dy), folder, settings)


def on_tiles(settings: dict[str, str], config: Config, tiles: Path, file: Path) -> None:
    """Write the configuration of a mesh as one of tiles: the keys of its server, its controller and its refiner."""
    server = {
        key: value for key, value in yaml.safe_load(CONFIGS["mesh"].read_text()).items() if key not in OF_ONE_MESH
    }
    server |= {key: yaml.safe_load(settings[key]) for key in ("refiners", "plan_refiner")}
    radius = cast(MeshMapParameters, config.sections["mesh_map"].parameters).inscribed_radius
    server |= {
        "backend": "tiles",
        "planners": [{"name": "far", "type": "tiles.hierarchical"}],
        "tiled_map": {"folder": str(tiles), "window": WINDOW, "inscribed_radius": radius},
    }
    file.write_text(yaml.safe_dump(server))


def drive(scenario: Scenario, seed: int, settings: dict[str, str], config: Config, tile_size: float) -> Iterator[Row]:
    """Drive one terrain on both maps."""
    with tempfile.TemporaryDirectory(prefix="mbf_outdoor_tiles_") as name:
        tiles, file = Path(name) / "tiles", Path(name) / "tiles.yaml"
        cut(scenario, seed, config, tile_size, tiles)
        on_tiles(settings, config, tiles, file)
        tiled = scenario.model_copy(update={"backend": "tiles", "navigation": {"tiles": file}})
        jobs = (scenario, SweepRun(seed, settings | FALLBACK)), (tiled, SweepRun(seed))
        for map_name, job in zip(MAPS, jobs, strict=True):
            metrics = run_once(job)
            kept = {key: metrics.get(key) for key in ("success", "verdict", "time_s", "path_length_m", "incidents")}
            yield {"map": map_name, "world": scenario.name, "seed": seed, **kept}


def evaluate(levels: range, seeds: range, tile_size: float, log: SweepLog) -> Iterator[Row]:
    """Rows of all terrains with a route, those of the log first."""
    protocol = outdoor([0])
    settings = {**protocol.entry(ENTRY).settings, **HEIGHT_LIMIT}
    config, _ = configuration_of(protocol, "mesh", settings)
    for seed in seeds:
        for level in levels:
            scenario, key = generated(level), f"{level}/{seed}/{tile_size:g}"
            if f"{key}/route" not in log.rows:
                log.append(f"{key}/route", {"route": has_route(scenario, seed)})
            if not log.rows[f"{key}/route"]["route"]:
                continue
            if not all(f"{key}/{name}" in log.rows for name in MAPS):
                for row in drive(scenario, seed, settings, config, tile_size):
                    log.append(f"{key}/{row['map']}", row)
            yield from (log.rows[f"{key}/{name}"] for name in MAPS)


def figures(rows: list[Row], name: str) -> dict[str, Any]:
    """What one map's runs come to."""
    here = [row for row in rows if row["map"] == name]
    times = [row["time_s"] for row in here if row["success"]]
    return {
        "map": name,
        "terrains": len(here),
        "arrived": len(times),
        "tipped over": sum("tipped_over" in (row["incidents"] or ()) for row in here),
        "median time [s]": round(float(np.median(times)), 1) if times else None,
    }


def numbers(text: str) -> range:
    """Read ``first:one past the last``."""
    return range(*map(int, text.split(":")))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--levels", type=numbers, default=range(10), help="of difficulty, first and one past the last")
    parser.add_argument("--seeds", type=numbers, default=range(8000, 8005), help="8000 to 8004 are for tuning")
    parser.add_argument("--tile-size", type=float, default=8.0, help="side of a tile [m]")
    parser.add_argument("--results", type=Path, help="file of finished runs, added to")
    parser.add_argument("--json", action="store_true", help="print the figures as last line")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        with SweepLog(arguments.results or Path(folder) / "runs.jsonl") as log:
            rows = list(evaluate(arguments.levels, arguments.seeds, arguments.tile_size, log))
    lines = [figures(rows, name) for name in MAPS]
    table = Table(*lines[0])
    for line in lines:
        table.add_row(*(str(value) for value in line.values()))
    console = Console()
    console.print(table)
    for row in rows:
        if not row["success"]:
            console.print(f"{row['world']}, seed {row['seed']}, {row['map']}: {row['verdict']}", markup=False)
    if arguments.json:
        print(json.dumps(lines))


if __name__ == "__main__":
    with interruptible():
        main()
