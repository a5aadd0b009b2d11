"""What ``mbf check`` knows of folders of tiles: every tile is read, and all that are damaged are listed."""

from __future__ import annotations

from pathlib import Path

from mbf_abstract.commands.check import Checked
from mbf_abstract.config.findings import ConfigError, Finding
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.index import INDEX_FILE, is_tile_folder, read_index
from mbf_mesh_nav.tiles.stored_tiles import sound_tile
from mbf_mesh_nav.tiles.tile import tile_file

EXPECTED = "a sound tile of this map"


def check(file: Path, load: bool) -> Checked | None:
    """Check a folder of tiles, to ``load`` it tile by tile; None for anything else.

    Raises
    ------
    ConfigError
        All tiles that are missing, damaged or of another map.
    MeshError
        The index is damaged or missing.
    """
    if not is_tile_folder(file):
        return None
    index = read_index(file)
    known = {tile_file(file, key).name for key in index.entries}
    findings = []
    for key in index.entries if load else ():
        try:
            sound_tile(file, index, key)
        except MeshError as error:
            findings.append(Finding(str(tile_file(file, key)), 1, "", EXPECTED, "; ".join(error.reasons)))
    if findings:
        raise ConfigError(findings)
    notes = []
    if strangers := sorted(path.name for path in file.glob("tile_*.npz") if path.name not in known):
        notes.append(f"{len(strangers)} files are not in {INDEX_FILE}, e.g. {strangers[0]}")
    vertices = sum(entry.core_vertices for entry in index.tiles)
    return Checked(f"{len(index.tiles)} tiles, {vertices} vertices, layers: {', '.join(index.layers)}", tuple(notes))
