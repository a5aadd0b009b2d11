"""``mbf tree``: list and draw the ready behaviour trees, without a robot and without a map."""

from __future__ import annotations

from pathlib import Path

import typer

from mbf_abstract.commands.reporting import readable_errors
from mbf_abstract.whole_files import write_whole


def register(app: typer.Typer) -> None:
    """Add the commands to the application ``mbf``."""
    trees = typer.Typer(help="Ready behaviour trees: list and draw them.", no_args_is_help=True)
    trees.command("list")(list_trees)
    trees.command("show")(show)
    app.add_typer(trees, name="tree")


def list_trees() -> None:
    """List the trees that come with the package."""
    from mbf_abstract.executives.reference_trees import REFERENCE_TREES

    for name, make in REFERENCE_TREES.items():
        typer.echo(f"{name:12} {(make.__doc__ or '').splitlines()[0]}")


def show(
    name: str = typer.Argument(..., help="Name of a tree (see mbf tree list)."),
    form: str = typer.Option("text", "--format", help="text, dot (for Graphviz) or svg."),
    out: Path | None = typer.Option(None, "--out", help="Write into this file instead of the terminal."),
) -> None:
    """Draw a tree."""
    with readable_errors(out):
        from mbf_abstract.executives.reference_trees import REFERENCE_TREES
        from mbf_abstract.executives.tree_drawing import FORMATS, draw_tree

        if name not in REFERENCE_TREES:
            raise typer.BadParameter(f"expected one of {', '.join(REFERENCE_TREES)}, got {name!r}", param_hint="NAME")
        if form not in FORMATS:
            raise typer.BadParameter(f"expected one of {', '.join(FORMATS)}, got {form!r}", param_hint="--format")
        drawing = draw_tree(REFERENCE_TREES[name](), form)
        if out is None:
            typer.echo(drawing, nl=False)
        else:
            write_whole(out, drawing)
