"""Building a tiled map, tile by tile: in any order, by several workers, and on from where a build was ended.

    source = HeightSource(np.load("heights.npy", mmap_mode="r"), 0.5, 0.5)
    build_tiles(source, Path("island"), TileSettings(mesh_map=parameters, layer_blocks=blocks))

A tile depends on the source and the settings only, so its bytes are the same however it comes about. A tile that is
there already, with the SHA-256 of the same source and settings in it, is not built again unless a layer was changed.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, IntArray
from mbf_mesh_nav.map.map_builder import compute_layers, plan_mesh_layers
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.checked_mesh import CheckedMesh
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.mesh.topology import MeshTopology, build_topology
from mbf_mesh_nav.tiles.building.sources import TilePart, TileSource
from mbf_mesh_nav.tiles.building.tile_settings import TileSettings, reach_of
from mbf_mesh_nav.tiles.index import INDEX_FILE, CostProfile, TileEntry, TileIndex, read_index, write_index
from mbf_mesh_nav.tiles.portals import group_shared
from mbf_mesh_nav.tiles.tile import Tile, TileKey, digest_of_layers, read_tile, tile_file, write_tile
from mbf_mesh_nav.tiles.tile_graph import costs_between_portals

Entries = Generator[TileEntry | None, None, None]
"""Of tiles as they are there, in any order; None for one without a face."""
EntriesOf = Callable[[Sequence[TileKey]], Entries]
"""Builds the tiles with some keys."""


class TileBuilder:
    """Builds the tiles of one source with one set of settings.

    Raises
    ------
    LayerListError
        The layers are not right, as of ``build_mesh_map``.
    MeshError
        A layer has no bound on how far it looks, or there are no layers.
    """

    def __init__(self, source: TileSource, settings: TileSettings) -> None:
        self._source, self._settings = source, settings
        self.build = settings.digest(source)
        self._plan = plan_mesh_layers(settings.mesh_map, settings.layer_blocks)
        self.layers = tuple(planned.entry.name for planned in self._plan)
        if not self._plan:
            raise MeshError("tiles", ["a tiled map needs at least one layer"])
        if bare := [planned.entry.name for planned in self._plan if not planned.layer_class.has_costs]:
            text = f"layer '{bare[0]}' has no costs that a tile could hold: list it under tiled_map of the server"
            raise MeshError("tiles", [text])
        self._reach = reach_of(self._plan)
        self._profiles = settings.all_profiles()
        self.default_layer = settings.mesh_map.default_layer or settings.mesh_map.layers[-1].name
        for name, profile in self._profiles.items():
            if profile.layer and profile.layer not in self.layers:
                known = ", ".join(self.layers)
                raise MeshError("tiles", [f"profile '{name}': expected a layer of {known}, got '{profile.layer}'"])

    def tile(self, key: TileKey) -> Tile | None:
        """Build a tile; None if there is no face in it."""
        part = self._source.part(key, self._settings.tile_size, self._reach)
        return None if part is None else self._from_part(part)

    def _from_part(self, part: TilePart) -> Tile:
        # 1. The mesh of core and overlap, and its layers as on any map.
        own = np.arange(len(part.vertices), dtype=np.int32), np.arange(len(part.faces), dtype=np.int32)
        topology = build_topology(CheckedMesh(part.vertices, part.faces, *own, own[0]))
        part_map = MeshMap(topology, self._settings.frame_id)
        if part.errors is not None:
            part_map.height_errors, part_map.place_errors = part.errors.of(topology.internal_to_input)
        layers = compute_layers(part_map, self._plan, "")
        # 2. The core comes first, otherwise all keep the order in which neighbours lie close in memory.
        is_core_face = topology.internal_to_input_faces < part.core_faces
        is_core, is_around = (_corners_of(topology, faces) for faces in (is_core_face, ~is_core_face))
        order = np.concatenate([np.flatnonzero(is_core), np.flatnonzero(~is_core)])
        place = np.empty(len(order), dtype=np.int32)
        place[order] = np.arange(len(order), dtype=np.int32)
        core = order[: int(is_core.sum())]
        # 3. The vertex graph of the core.
        offsets, neighbours = _graph_of_core(topology, is_core, place)
        # 4. Vertices that cores of other tiles have, too, and the portals they form.
        shared = np.flatnonzero(is_around[core]).astype(np.int32)
        vertices = topology.vertices[order]
        portals, portal_of = group_shared(vertices[shared], self._settings.cube)
        costs = np.array([layers[name].costs[core] for name in self.layers])
        lethal = np.array([layers[name].lethal[core] for name in self.layers])
        tile = Tile(
            vertices=vertices,
            numbers=part.numbers[topology.internal_to_input[order]],
            faces=place[np.concatenate([topology.faces[is_core_face], topology.faces[~is_core_face]])],
            core_faces=np.array([part.core_faces]),
            normals=topology.vertex_normals[core].astype(np.float32),
            offsets=offsets,
            neighbours=neighbours,
            costs=costs,
            lethal=lethal,
            shared=shared,
            portals=portals,
            portal_of=portal_of,
            portal_costs=np.zeros((0, len(portals), len(portals)), dtype=np.float32),
            build=np.frombuffer(bytes.fromhex(self.build), dtype=np.uint8),
            values=digest_of_layers(costs, lethal),
        )
        # 5. What it costs to pass.
        return replace(tile, portal_costs=np.array([self._passing(tile, one) for one in self._profiles.values()]))

    def _passing(self, tile: Tile, profile: CostProfile) -> np.ndarray[Any, np.dtype[np.float32]]:
        row = self.layers.index(profile.layer or self.default_layer)
        return costs_between_portals(tile, tile.costs[row], tile.lethal[row], profile)


def _corners_of(topology: MeshTopology, is_chosen: BoolArray) -> BoolArray:
    """Mask (V,) of the vertices of the chosen faces (F,)."""
    mask = np.zeros(topology.vertex_count, dtype=np.bool_)
    mask[topology.faces[is_chosen]] = True
    return mask


def _graph_of_core(topology: MeshTopology, is_core: BoolArray, place: IntArray) -> tuple[IntArray, IntArray]:
    """Offsets and neighbours of the core's vertices, which come first in the order ``place`` (V,)."""
    starts = np.repeat(np.arange(topology.vertex_count), np.diff(topology.neighbour_offsets))
    kept = is_core[starts] & is_core[topology.neighbours]
    offsets = np.zeros(int(is_core.sum()) + 1, dtype=np.int32)
    np.cumsum(np.bincount(place[starts[kept]], minlength=len(offsets) - 1), out=offsets[1:])
    return offsets, place[topology.neighbours[kept]]


def build_tiles(
    source: TileSource,
    folder: Path,
    settings: TileSettings,
    *,
    workers: int = 1,
    entries_of: EntriesOf | None = None,
    name: str = "",
    on_tile: Callable[[int, int], None] = lambda done, total: None,
) -> TileIndex:
    """Build a tiled map, or what is missing of it.

    Parameters
    ----------
    folder : path
        Made if it is missing.
    workers : int
        Tiles built at the same time, by threads: the kernels do not hold the interpreter's lock.
    entries_of : callable, optional
        Builds the tiles instead of these threads, such as ``cluster_build.entries_from_cluster``.
    name : str
        What the index calls the source.
    on_tile : callable, optional
        Called with the numbers of finished and of all tiles. What it raises ends the build, which may go on later.

    Raises
    ------
    MeshError
        The folder holds another map, a file cannot be written, the source has no face; as of ``TileBuilder``.
    """
    builder = TileBuilder(source, settings)
    _prepare(folder, builder.build)
    keys, entries = source.keys(settings.tile_size), []
    with closing((entries_of or partial(_by_threads, builder, folder, workers))(keys)) as built:
        for done, entry in enumerate(built, start=1):
            if entry is not None:
                entries.append(entry)
            on_tile(done, len(keys))
    if not entries:
        raise MeshError(name or "tiles", ["there is no face in it"])
    index = TileIndex(
        build=builder.build,
        source=name,
        frame_id=settings.frame_id,
        tile_size=settings.tile_size,
        portal_length=settings.cube,
        inscribed_radius=settings.mesh_map.inscribed_radius,
        layers=builder.layers,
        default_layer=builder.default_layer,
        profiles=settings.all_profiles(),
        tiles=tuple(sorted(entries, key=lambda entry: entry.key)),
    )
    write_index(folder, index)
    return index


def _prepare(folder: Path, build: str) -> None:
    """Make the folder, or check that it holds the same map; remove what a broken build has left."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MeshError(str(folder), [f"cannot be made: {error.strerror or error}"]) from error
    if (folder / INDEX_FILE).exists() and read_index(folder).build != build:
        raise MeshError(str(folder), ["holds a map of another source or with other settings; give another folder"])
    for unfinished in folder.glob(".tile_*.npz"):
        unfinished.unlink(missing_ok=True)


def _by_threads(builder: TileBuilder, folder: Path, workers: int, keys: Sequence[TileKey]) -> Entries:
    """Build the tiles that are missing, by threads of this process."""
    with ThreadPoolExecutor(max_workers=workers) as pool:
        futures = [pool.submit(entry_of, builder, tile_file(folder, key), key) for key in keys]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def entry_of(builder: TileBuilder, path: Path, key: TileKey) -> TileEntry | None:
    """Entry of a tile, which is built unless it is there and sound; None if it has no face."""
    tile = None
    if path.exists():
        try:
            tile = read_tile(path)
        except MeshError:
            pass  # of a disk that was full: built again
    if tile is None or tile.build.tobytes().hex() != builder.build or not tile.is_as_built:
        tile = builder.tile(key)
        if tile is None:
            return None
        write_tile(path, tile)
    core = tile.vertices[: tile.core_vertices]
    box = (*core.min(axis=0).tolist(), *core.max(axis=0).tolist())
    return TileEntry(
        key=key, core_vertices=len(core), neighbours=len(tile.neighbours), shared=len(tile.shared), box=box
    )
