"""``mbf plugins``: every plugin that is installed, where it comes from, and why it cannot be used.

Plugins of other packages are imported, to see whether they can be. Those of this package are not, which saves a second
or two: ``mbf doctor`` imports all of them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

import typer

from mbf_abstract.commands.reporting import FAILURE, readable_errors
from mbf_abstract.config.installed_plugins import GROUPS, PluginEntry, entry_of, is_ours, points_of


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("plugins")(list_plugins)


def list_plugins(
    kind: str = typer.Option("", "--kind", help="Only one kind, e.g. planners, controllers, mesh_layers."),
    as_json: bool = typer.Option(False, "--json", help="Print a JSON list instead of a table."),
) -> None:
    """List all plugins; exit code 1 if one of another package cannot be imported."""
    if kind and kind not in GROUPS:
        raise typer.BadParameter(f"no kind {kind!r}; known: {', '.join(GROUPS)}", param_hint="--kind")
    with readable_errors():
        entries = [entry for group in GROUPS if kind in ("", group) for entry in _entries(group)]
    if as_json:
        rows = [
            {"name": e.name, "kind": e.group, "type": e.target, "from": e.origin, "error": e.error} for e in entries
        ]
        typer.echo(json.dumps(rows, indent=2))
    else:
        _print_table([(e.name, e.group, e.target, e.origin, e.error or "") for e in entries])
    if any(entry.error for entry in entries):
        raise typer.Exit(FAILURE)


def _entries(group: str) -> Iterator[PluginEntry]:
    """Yield the plugins of a group by name; those of other packages are imported."""
    for name, points in sorted(points_of(group).items()):
        if is_ours(points):
            yield entry_of(group, points)
        else:
            from mbf_abstract.config.registry import PluginRegistry

            yield PluginRegistry().entry(group, name)


def _print_table(rows: list[tuple[str, str, str, str, str]]) -> None:
    """Print columns; plain text that can be piped, not cut to the width of the terminal."""
    header = ("name", "kind", "type", "from", "error")
    table = [header, *rows]
    widths = [max(len(row[column]) for row in table) for column in range(len(header))]
    for row in table:
        typer.echo("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())
    typer.echo(f"{len(rows)} plugins")
