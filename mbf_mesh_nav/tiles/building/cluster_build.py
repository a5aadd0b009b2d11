"""Tiles built on a Dask cluster: each worker opens the source itself and writes its tiles into the shared folder.

    order = BuildOrder(Path("/shared/heights.npy"), 0.5, settings, Path("/shared/island"), builder_digest)
    build_tiles(source, order.folder, settings, entries_of=partial(entries_from_cluster, order, "tcp://10.0.0.1:8786"))

When to use: maps that one machine builds for hours. When not: on one machine, where ``workers`` of ``build_tiles`` read
the source once for all of them. A tile is the same whoever builds it, so the map has the bytes of any other build.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path

from mbf_abstract.cluster import run_on_cluster
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.building.build import Entries, TileBuilder, entry_of
from mbf_mesh_nav.tiles.building.source_files import open_source
from mbf_mesh_nav.tiles.building.tile_settings import TileSettings
from mbf_mesh_nav.tiles.index import TileEntry
from mbf_mesh_nav.tiles.tile import TileKey, tile_file


@dataclass(frozen=True)
class BuildOrder:
    """What a worker has to know to build any tile of a map.

    Attributes
    ----------
    source : path
        The file as ``open_source`` takes it, under the same absolute path on every machine.
    spacing : float
        Of the samples of a ``.npy`` file [m], else 0.
    folder : path
        Of the map, shared by all machines.
    build : str
        Hexadecimal SHA-256 of source and settings, by which a worker knows that it reads the same file.
    """

    source: Path
    spacing: float
    settings: TileSettings = field(compare=False)
    folder: Path
    build: str


def entries_from_cluster(order: BuildOrder, address: str, keys: Sequence[TileKey]) -> Entries:
    """Have all tiles built by the workers of the scheduler at ``address``; yield entries as their tiles are there.

    Raises
    ------
    ClusterError
        As of ``run_on_cluster``.
    MeshError
        A worker cannot read the source, reads another one, or does not write into the folder of this machine.
    """
    for key, entry in run_on_cluster(partial(build_ordered, order), keys, address):
        if entry is not None and not (file := tile_file(order.folder, key)).is_file():
            text = "a worker has built it, but not here: expected a folder that all machines share"
            raise MeshError(str(file), [text])
        yield entry


def build_ordered(order: BuildOrder, key: TileKey) -> TileEntry | None:
    """Build one tile unless it is there; its entry, None if it has no face. Raises MeshError as above."""
    return entry_of(_builder(order), tile_file(order.folder, key), key)


@lru_cache(maxsize=1)
def _builder(order: BuildOrder) -> TileBuilder:
    """The source of an order, opened once in a worker."""
    builder = TileBuilder(open_source(order.source, order.settings.mesh_map, order.spacing), order.settings)
    if builder.build != order.build:
        text = "a worker reads another file there, or has another version, than the machine that orders the tiles"
        raise MeshError(str(order.source), [text])
    return builder
