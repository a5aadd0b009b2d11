"""Reading the tiles of a map, checked against its index."""

from __future__ import annotations

from pathlib import Path

from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.index import TileIndex
from mbf_mesh_nav.tiles.tile import Tile, TileKey, read_tile, tile_file


def sound_tile(folder: Path, index: TileIndex, key: TileKey) -> Tile:
    """Read a tile of a map; ``MeshError`` if it is damaged or not of this map."""
    path, entry = tile_file(folder, key), index.entries[key]
    tile = read_tile(path)
    found = (tile.core_vertices, len(tile.neighbours), len(tile.shared), len(tile.costs))
    expected = (entry.core_vertices, entry.neighbours, entry.shared, len(index.layers))
    if found != expected or tile.build.tobytes().hex() != index.build:
        raise MeshError(str(path), ["belongs to another map than the index"])
    core = tile.vertices[: tile.core_vertices]
    if (*core.min(axis=0).tolist(), *core.max(axis=0).tolist()) != entry.box:
        raise MeshError(str(path), ["does not lie where the index states"])
    if len(tile.portal_costs) != len(index.profiles):
        reason = f"has costs of {len(tile.portal_costs)} profiles, the index has {len(index.profiles)}"
        raise MeshError(str(path), [reason])
    return tile
