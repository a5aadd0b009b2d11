"""The world of Table I as a YAML file: a floor, six waypoints, and the routes of the other robots.

``warehouse.yaml`` ships; ``mbf bench table1 --world FILE`` takes another. A world names either a ``floor_plan`` of ours
or a map_server ``map``; both count from the folder of the file.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Protocol

from pydantic import model_validator

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import load_yaml
from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.worlds.floor_plan import read_floor_plan
from terrain.worlds.occupancy import OccupancyGrid, read_occupancy

WAREHOUSE = Path(__file__).with_name("warehouse.yaml")


class World(Protocol):
    """What an environment asks of a world: a floor, where our robot goes, and the routes of the others."""

    @property
    def start(self) -> tuple[float, float, float]:
        """Where our robot starts: x, y [m], yaw [rad]."""

    @property
    def routes(self) -> tuple[tuple[tuple[float, float], ...], ...]:
        """Closed routes of the others [m]."""

    def grid(self) -> OccupancyGrid:
        """Return the floor."""

    def goals(self) -> list[Pose]:
        """Return the waypoints as poses."""


class Table1World(ParameterModel):
    """One world file."""

    name: str = parameter(..., "Short name, for tables.")
    floor_plan: Path | None = parameter(None, "Floor plan of our own format.")
    map: Path | None = parameter(None, "map_server yaml, instead of a floor plan.")
    start: tuple[float, float, float] = parameter(..., "Where our robot starts: x, y, yaw.")
    waypoints: tuple[tuple[float, float, float], ...] = parameter(..., "Where it goes, in order: x, y, yaw.")
    routes: tuple[tuple[tuple[float, float], ...], ...] = parameter(
        ..., "Closed routes of the others, one robot each, the first first.", unit="m"
    )

    @model_validator(mode="after")
    def _has_one_floor_and_somewhere_to_go(self) -> Table1World:
        if (self.floor_plan is None) == (self.map is None):
            raise ValueError("either floor_plan or map")
        if not self.waypoints or any(len(route) < 2 for route in self.routes):
            raise ValueError("at least one waypoint, and routes of at least two corners")
        return self

    def grid(self) -> OccupancyGrid:
        """Return the floor; raises FloorPlanError or ConfigError."""
        if self.map is not None:
            return read_occupancy(self.map)
        assert self.floor_plan is not None
        return read_floor_plan(self.floor_plan).draw()

    def goals(self) -> list[Pose]:
        """Return the waypoints as poses."""
        return [Pose.planar(*waypoint) for waypoint in self.waypoints]


def load_world(file: str | os.PathLike[str] = WAREHOUSE) -> Table1World:
    """Read a world file; raises ConfigError with all findings."""
    document = load_yaml(Path(file))
    findings: list[Finding] = []
    world = validate(Table1World, document.data, document, (), findings)
    if world is None or findings:
        raise ConfigError(findings)
    folder = document.path.parent
    files = {key: folder / path for key in ("floor_plan", "map") if (path := getattr(world, key)) is not None}
    return world.model_copy(update=files)
