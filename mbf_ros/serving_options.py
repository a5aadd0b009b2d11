"""Options that the commands share which serve a navigator to clients of ROS."""

from __future__ import annotations

import typer

KEEP_GOALS = typer.Option(False, "--keep-goals", help="A goal goes on when its client is gone; else it is canceled.")
MAP_PERIOD = typer.Option(
    1.0, "--map-period", min=0.05, help="Least time between two messages of a costmap or a mesh, in s."
)
