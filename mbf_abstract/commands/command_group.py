"""The help of ``mbf`` and of its groups of commands."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup

LONGEST = 400  # characters of a command's first sentence; longer ones are cut


class CommandGroup(TyperGroup):
    """A group whose help shows the first sentence of each command in full, where typer cuts it to one line."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a line or more for each command."""
        commands = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        rows = [(name, one.get_short_help_str(LONGEST)) for name, one in commands if one is not None and not one.hidden]
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)
