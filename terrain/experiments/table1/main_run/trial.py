"""One run of the main run, and the compact row that is kept of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mbf_abstract.config.yaml_source import load_yaml
from mbf_abstract.time.clock import wall_seconds
from terrain.experiments.table1 import counting, plugin_wrappers, repetition
from terrain.experiments.table1.counting import Leg, Tally
from terrain.experiments.table1.environments import warehouse_environment as warehouse
from terrain.experiments.table1.main_run.buildings import buildings, head_start
from terrain.experiments.table1.main_run.conditions import CONDITIONS
from terrain.provenance.frozen_keys import under_frozen_keys

NAVIGATION = Path(__file__).with_name("navigation.yaml")
FROZEN_KEYS = {"check_ahead_time": "collision_check_time"}  # of parameters that have another name now
LOST_TEXT = 160  # characters that are kept of why a leg was lost


@dataclass(frozen=True)
class Trial:
    """A condition in a building on a seed; ``depot``: world file of that building."""

    building: str
    seed: int
    condition: str
    depot: Path | None
    parameters_hash: str

    @property
    def key(self) -> str:
        """Name in the file of rows."""
        return f"{self.parameters_hash}/{self.building}/{self.seed}/{self.condition}"


def parameters_of(building: str, depot: Path | None) -> dict[str, Any]:
    """Everything that a row of a building depends on beside the code."""
    return {
        "conditions": {name: asdict(condition) for name, condition in CONDITIONS.items()},
        "navigation": load_yaml(NAVIGATION).data,
        "building": buildings(depot)[building].parameters(),
        **warehouse.constants(),
        "leg_time_limit": repetition.LEG_TIME_LIMIT,
        "useless_within": counting.USELESS_WITHIN,
        "latency": [plugin_wrappers.QUERY_CELL, plugin_wrappers.LATENCY_SPREAD],
    }


def hash_of_parameters(building: str, depot: Path | None) -> str:
    """Return a short hash of ``parameters_of``: a new name of a key is no new parameter."""
    text = json.dumps(under_frozen_keys(parameters_of(building, depot), FROZEN_KEYS), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def run_trial(trial: Trial) -> dict[str, Any]:
    """Drive and return the row."""
    started = wall_seconds()
    condition, building = CONDITIONS[trial.condition], buildings(trial.depot)[trial.building]
    world, ahead = building.half_round(trial.seed), head_start(trial.seed)
    surroundings = condition.base.surroundings
    with warehouse.WarehouseEnvironment(world, surroundings, trial.seed, NAVIGATION, ahead) as environment:
        run = repetition.drive(environment, condition.executive(environment.navigator), started)
    return {**row_of(run.tally), "digest": run.digest[:12], "seconds": round(run.wall_time, 1)}


def row_of(tally: Tally) -> dict[str, Any]:
    """Compact JSON values of a tally; times in s, distances in m, reasons of lost legs by their number."""
    lost = {str(i): leg.message[:LOST_TEXT] for i, leg in enumerate(tally.legs) if leg.end != "reached"}
    return {
        "planner": tally.planner_calls,
        "controller": tally.controller_calls,
        "recoveries": tally.recoveries,
        "useless": tally.useless,
        "contacts": tally.contacts,
        "legs": [[leg.end, round(leg.time, 2), round(leg.distance, 2)] for leg in tally.legs],
        **({"lost": lost} if lost else {}),
    }


def tally_of(row: Mapping[str, Any]) -> Tally:
    """Read a row back; what it does not hold, the split of the time and the control cycles, is empty."""
    legs = [Leg(end, time, distance) for end, time, distance in row["legs"]]
    return Tally(row["planner"], row["controller"], 0, row["recoveries"], row["useless"], row["contacts"], legs)
