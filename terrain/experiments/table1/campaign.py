"""All runs of the experiment, in worker processes; each is done once and its result is kept.

Finished runs are kept in ``runs.jsonl`` of the campaign's folder, under a key that holds the hash of all parameters. An
interrupted campaign continues where it stopped; a change of any parameter repeats all runs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mbf_abstract.config.yaml_source import load_yaml
from terrain.experiments.table1 import counting, plugin_wrappers, repetition
from terrain.experiments.table1.conditions import CONDITIONS, outdoors, without_traffic
from terrain.experiments.table1.counting import Leg, Tally
from terrain.experiments.table1.environments import warehouse_environment as warehouse
from terrain.experiments.table1.environments.outdoor_environment import OUTDOOR
from terrain.experiments.table1.environments.world import load_world
from terrain.experiments.table1.repetition import run_repetition
from terrain.sweeps.log import rows_of

LOG = "runs.jsonl"


@dataclass(frozen=True)
class Job:
    """One run: a condition, a seed, a world file; ``empty`` = without traffic, ``again`` = for the second time."""

    condition: str
    seed: int
    world: Path
    empty: bool = False
    again: bool = False

    @property
    def name(self) -> str:
        """Name within one set of parameters."""
        return f"{self.condition}{'/empty' if self.empty else ''}{'/again' if self.again else ''}/{self.seed}"


def do(job: Job) -> dict[str, Any]:
    """Run a job and return its row."""
    condition = outdoors(CONDITIONS[job.condition]) if job.world == OUTDOOR else CONDITIONS[job.condition]
    row = run_repetition(without_traffic(condition) if job.empty else condition, job.world, job.seed).to_row()
    return {"condition": job.condition, "seed": job.seed, "empty": job.empty, **row}


def parameters_of(world_file: Path) -> dict[str, Any]:
    """Everything a result depends on beside the code: conditions, navigation, world, constants."""
    if world_file == OUTDOOR:
        navigation = load_yaml(OUTDOOR.with_name("outdoor_navigation.yaml")).data
        conditions = {name: asdict(outdoors(condition)) for name, condition in CONDITIONS.items()}
        changed = {"conditions": conditions, "world": load_yaml(OUTDOOR).data, "navigation": navigation}
        return {**_parameters_of_conditions(), **changed}
    world = load_world(world_file)
    grid = world.grid()
    return {
        **_parameters_of_conditions(),
        "navigation": load_yaml(warehouse.NAVIGATION).data,
        "world": json.loads(world.model_dump_json(exclude={"floor_plan", "map"})),
        "floor": hashlib.sha256(grid.occupied.tobytes() + grid.free.tobytes()).hexdigest(),
        **warehouse.constants(),
    }


def _parameters_of_conditions() -> dict[str, Any]:
    return {
        "conditions": {name: asdict(condition) for name, condition in CONDITIONS.items()},
        "leg_time_limit": repetition.LEG_TIME_LIMIT,
        "useless_within": counting.USELESS_WITHIN,
        "latency": [plugin_wrappers.QUERY_CELL, plugin_wrappers.LATENCY_SPREAD],
    }


def hash_of_parameters(world_file: Path) -> str:
    """Return a short hash of ``parameters_of``."""
    text = json.dumps(parameters_of(world_file), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Campaign:
    """The runs of one world, kept in a folder."""

    def __init__(self, folder: Path, world: Path, workers: int = 1) -> None:
        self.world = world
        self.workers = workers
        self.parameters_hash = hash_of_parameters(world)
        self._file = folder / LOG

    def rows(self, jobs: Sequence[Job]) -> Iterator[tuple[Job, dict[str, Any]]]:
        """Yield every job with its row: first those that are known, then the others as they finish."""
        return rows_of({job: f"{self.parameters_hash}/{job.name}" for job in jobs}, self._file, do, self.workers)

    def job(self, condition: str, seed: int, empty: bool = False, again: bool = False) -> Job:
        """Make a job in this campaign's world."""
        return Job(condition, seed, self.world, empty, again)


def tally_of(row: Mapping[str, Any]) -> Tally:
    """Read back the tally of a row."""
    values = dict(row["tally"])
    return Tally(**{**values, "legs": [Leg(**leg) for leg in values["legs"]]})
