"""``mbf plugins``: every plugin that is installed, where it comes from, and why it cannot be used."""

from __future__ import annotations

import json

import typer

from mbf_abstract.commands.reporting import FAILURE, readable_errors


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("plugins")(list_plugins)


def list_plugins(
    kind: str = typer.Option("", "--kind", help="Only one kind, e.g. planners, controllers, mesh_layers."),
    as_json: bool = typer.Option(False, "--json", help="Print a JSON list instead of a table."),
) -> None:
    """List all plugins; exit code 1 if one of them cannot be imported."""
    from mbf_abstract.config.registry import GROUPS, PluginRegistry

    if kind and kind not in GROUPS:
        raise typer.BadParameter(f"no kind {kind!r}; known: {', '.join(GROUPS)}", param_hint="--kind")
    with readable_errors():
        entries = [entry for entry in PluginRegistry().entries() if kind in ("", entry.group)]
    if as_json:
        rows = [
            {"name": e.name, "kind": e.group, "type": e.target, "from": e.origin, "error": e.error} for e in entries
        ]
        typer.echo(json.dumps(rows, indent=2))
    else:
        _print_table([(e.name, e.group, e.target, e.origin, e.error or "") for e in entries])
    if any(entry.error for entry in entries):
        raise typer.Exit(FAILURE)


def _print_table(rows: list[tuple[str, str, str, str, str]]) -> None:
    """Print columns; plain text that can be piped, not cut to the width of the terminal."""
    header = ("name", "kind", "type", "from", "error")
    table = [header, *rows]
    widths = [max(len(row[column]) for row in table) for column in range(len(header))]
    for row in table:
        typer.echo("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())
    typer.echo(f"{len(rows)} plugins")
