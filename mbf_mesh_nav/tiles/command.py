"""``mbf map tile``: a map of tiles, for what does not fit into memory."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import cast

import typer

from mbf_abstract.commands.reporting import readable_errors
from mbf_abstract.commands.waiting import waiting


def tile(
    source: Path = typer.Argument(..., metavar="INPUT", help="Heights (.npy), an elevation model, or a mesh."),
    out: Path = typer.Option(..., "--out", help="Folder of the map; a build that was ended goes on in it."),
    config: Path | None = typer.Option(
        None, "--config", help="Mesh configuration with the layers; else those of a bare mesh."
    ),
    tile_size: float = typer.Option(256.0, "--tile-size", min=1e-3, help="Side of a tile [m]."),
    portal_length: float = typer.Option(
        0.0, "--portal-length", min=0.0, help="Length of a portal [m]; 0 = a sixteenth of a tile."
    ),
    spacing: float = typer.Option(0.0, "--spacing", min=0.0, help="Distance of the heights of a .npy file [m]."),
    workers: int = typer.Option(1, "--workers", min=1, help="Tiles built at the same time."),
    scheduler: str | None = typer.Option(
        None, "--scheduler", help="Address of a Dask scheduler, whose workers build the tiles in the shared folder."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print the figures as one JSON object."),
) -> None:
    """Cut a map into tiles, compute their layers and what it costs to pass them."""
    with readable_errors(out):
        from mbf_abstract.server.factory import read_config
        from mbf_abstract.server.standing_server import read_config_text
        from mbf_mesh_nav.files.vertex_errors import read_vertex_errors
        from mbf_mesh_nav.map.height_error import with_height_error
        from mbf_mesh_nav.map.map_builder import height_error_of
        from mbf_mesh_nav.map.map_parameters import MeshMapParameters
        from mbf_mesh_nav.server import BARE_MESH
        from mbf_mesh_nav.tiles.building.build import build_tiles
        from mbf_mesh_nav.tiles.building.cluster_build import BuildOrder, entries_from_cluster
        from mbf_mesh_nav.tiles.building.source_files import open_source
        from mbf_mesh_nav.tiles.building.tile_settings import TileSettings

        _, checked = read_config_text(BARE_MESH.format(file='""')) if config is None else read_config(config)
        if "mesh_map" not in checked.sections:
            raise typer.BadParameter(f"expected a configuration with a mesh_map, got {config}", param_hint="--config")
        section = checked.sections["mesh_map"]
        parameters = cast(MeshMapParameters, section.parameters)
        error = None if read_vertex_errors(source) is not None else height_error_of(str(source))
        settings = TileSettings(
            mesh_map=parameters,
            layer_blocks={layer.name: with_height_error(layer.parameters, error) for layer in section.layers},
            tile_size=tile_size,
            portal_length=portal_length,
            frame_id=checked.parameters.global_frame,
        )
        with waiting(f"reading {source.name}") as say:
            opened = open_source(source, parameters, spacing)
            entries_of = None
            if scheduler is not None:
                order = BuildOrder(source.resolve(), spacing, settings, out.resolve(), settings.digest(opened))
                entries_of = partial(entries_from_cluster, order, scheduler)
            index = build_tiles(
                opened,
                out,
                settings,
                workers=workers,
                entries_of=entries_of,
                name=source.name,
                on_tile=lambda done, total: say(f"{done} of {total} tiles"),
            )
    vertices = sum(entry.core_vertices for entry in index.tiles)
    figures = {"map": str(out), "tiles": len(index.tiles), "vertices": vertices, "layers": list(index.layers)}
    if as_json:
        typer.echo(json.dumps(figures))
        return
    for name, value in figures.items():
        typer.echo(f"{name:9} {', '.join(value) if isinstance(value, list) else value}")
