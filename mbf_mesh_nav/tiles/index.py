"""The index of a tiled map: what its tiles are, where they lie, and what they were built with; ``index.json``.

It is written last and replaced as a whole, so a folder without one is a map that is not complete.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator
from rtree import index as rtree_index

from mbf_abstract.config.bounded_files import special_file
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.whole_files import write_whole
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.tile import TileKey

INDEX_FILE = "index.json"
MAX_INDEX_BYTES = 256 * 2**20

Box = tuple[float, float, float, float, float, float]
"""Least x, y, z and greatest x, y, z [m]."""


class CostProfile(ParameterModel):
    """What a robot pays for on a tiled map; costs between portals are kept for each profile."""

    layer: str = parameter("", "The layer whose costs and lethal flags count; empty = the map's default layer.")
    edge_cost_factor: float = parameter(0.0, "How much a cost of 1 lengthens an edge, in lengths.", ge=0.0, le=100.0)
    cost_limit: float = parameter(1.0, "Vertices whose cost reaches this are impassable.", gt=0.0, allow_inf=True)


class TileEntry(BaseModel):
    """One tile: its place in the grid, its sizes, and the box around its core."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    key: TileKey
    core_vertices: int = Field(ge=3)
    neighbours: int = Field(ge=6)
    shared: int = Field(ge=0)
    box: Box

    @field_validator("box")
    @classmethod
    def _box_is_one(cls, box: Box) -> Box:
        if any(least > greatest for least, greatest in zip(box[:3], box[3:], strict=True)):
            raise ValueError("expected least x, y, z and greatest x, y, z")
        return box


class TileIndex(BaseModel):
    """The index of a map.

    Attributes
    ----------
    build : str
        SHA-256 of source and settings, as in every tile.
    layers : tuple of str
        Names, in the order of the tiles' rows.
    profiles : dict
        In the order of the tiles' portal costs.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    format: Literal["mbf tiles"] = "mbf tiles"
    version: Literal[1] = 1
    build: str = Field(pattern="^[0-9a-f]{64}$")
    source: str
    frame_id: str
    tile_size: float = Field(gt=0.0)
    portal_length: float = Field(gt=0.0)
    inscribed_radius: float = Field(ge=0.0)
    layers: tuple[str, ...] = Field(min_length=1)
    default_layer: str
    profiles: dict[str, CostProfile] = Field(min_length=1)
    tiles: tuple[TileEntry, ...] = Field(min_length=1)

    @field_validator("tiles")
    @classmethod
    def _keys_are_unique(cls, tiles: tuple[TileEntry, ...]) -> tuple[TileEntry, ...]:
        keys = Counter(entry.key for entry in tiles)
        key, times = keys.most_common(1)[0]
        if times > 1:
            raise ValueError(f"expected each tile once, {key} is there {times} times")
        return tiles

    def profile(self, name: str = "") -> tuple[int, CostProfile]:
        """Place and values of a profile, the first one without a name; KeyError if there is none of that name."""
        wanted = name or next(iter(self.profiles))
        if wanted not in self.profiles:
            raise KeyError(f"no cost profile {wanted!r}, the map has: {', '.join(self.profiles)}")
        return list(self.profiles).index(wanted), self.profiles[wanted]

    def layer_of(self, profile: CostProfile) -> int:
        """Row of the layer that a profile looks at."""
        return self.layers.index(profile.layer or self.default_layer)

    @cached_property
    def entries(self) -> dict[TileKey, TileEntry]:
        """Tiles by their keys."""
        return {entry.key: entry for entry in self.tiles}

    @cached_property
    def box(self) -> Box:
        """The box around all tiles."""
        low = [min(one.box[axis] for one in self.tiles) for axis in range(3)]
        high = [max(one.box[axis] for one in self.tiles) for axis in range(3, 6)]
        return low[0], low[1], low[2], high[0], high[1], high[2]

    @cached_property
    def spacing(self) -> float:
        """About how far [m] vertices lie from each other in the tile with the most of them.

        They are taken to lie on the largest side of the box around them; that is the ground, but for a lone wall.
        """
        fullest = max(self.tiles, key=lambda one: one.core_vertices)
        x, y, z = (fullest.box[axis + 3] - fullest.box[axis] for axis in range(3))
        return math.sqrt(max(x * y, y * z, z * x) / fullest.core_vertices)

    @cached_property
    def _boxes(self) -> Any:
        """Index over the tiles' boxes, by their place in ``tiles``."""
        settings = rtree_index.Property(dimension=3)
        return rtree_index.Index(((place, one.box, None) for place, one in enumerate(self.tiles)), properties=settings)

    def tiles_in(self, box: Box) -> list[TileKey]:
        """Tiles whose boxes touch a box, ascending."""
        return sorted(self.tiles[place].key for place in self._boxes.intersection(box))


def write_index(folder: Path, index: TileIndex) -> None:
    """Write the index of a map's folder, as a whole; ``MeshError`` if that fails."""
    path = folder / INDEX_FILE
    try:
        write_whole(path, json.dumps(index.model_dump(mode="python"), indent=1))
    except OSError as error:
        raise MeshError(str(path), [f"cannot be written: {error.strerror or error}"]) from error


def is_tile_folder(folder: Path) -> bool:
    """Whether a folder holds a map of tiles, also one that is not complete."""
    return folder.is_dir() and ((folder / INDEX_FILE).exists() or any(folder.glob("tile_*.npz")))


def read_index(folder: Path) -> TileIndex:
    """Read the index of a map's folder.

    Raises
    ------
    MeshError
        There is none, or it is damaged; the text names the key, what was expected and what was found.
    """
    path = folder / INDEX_FILE
    if not folder.is_dir():
        raise MeshError(str(folder), ["there is no such folder of tiles"])
    if not path.is_file():
        kind = special_file(path)
        built = len(list(folder.glob("tile_*.npz")))
        reason = f"is {kind}, expected a file" if kind else f"is missing; {built} tiles are there"
        raise MeshError(str(path), [reason], "A build that was ended goes on when it is started again")
    if path.stat().st_size > MAX_INDEX_BYTES:
        raise MeshError(str(path), [f"{path.stat().st_size} bytes, the limit is {MAX_INDEX_BYTES}"])
    try:
        index = TileIndex.model_validate(json.loads(path.read_bytes()))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise MeshError(str(path), [f"'{key}': {first['msg']}, got {str(first['input'])[:80]}"]) from error
    except (OSError, ValueError, RecursionError) as error:
        raise MeshError(str(path), [f"cannot be read: {error}"]) from error
    for name, profile in {"": CostProfile(layer=index.default_layer), **index.profiles}.items():
        if (profile.layer or index.default_layer) not in index.layers:
            key = f"profiles.{name}.layer" if name else "default_layer"
            raise MeshError(str(path), [f"'{key}': expected one of {', '.join(index.layers)}, got '{profile.layer}'"])
    return index
