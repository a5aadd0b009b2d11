"""A picture of how the result of the main run settles: ratios to move_base after one, two, three ... seeds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from terrain.experiments.table1.main_run import table
from terrain.experiments.table1.main_run.table import Tallies, learning_curve

MEASURES = {"planner_ratio": "planner calls", "time_ratio": "time"}
DOTS_PER_INCH = 90


def draw_curves(file: Path, groups: Mapping[str, Tallies]) -> None:
    """Write a PNG with a column for each group and a row for each measure; there must be a group."""
    shape = {"nrows": len(MEASURES), "ncols": len(groups)}
    figure, axes = plt.subplots(**shape, figsize=(3.6 * len(groups), 5.6), squeeze=False, sharey="row")
    for column, (group, tallies) in enumerate(groups.items()):
        for row, (measure, text) in enumerate(MEASURES.items()):
            axis, ratios = axes[row][column], learning_curve(tallies, measure)
            seeds = range(1, len(ratios) + 1)
            axis.fill_between(seeds, [r.low for r in ratios], [r.high for r in ratios], alpha=0.25)
            axis.plot(seeds, [r.value for r in ratios])
            axis.axhline(1.0, color="black", linewidth=0.6)
            axis.set_title(group, fontsize=9)
            axis.set_xlabel("seeds")
            axis.set_ylabel(f"{text}, {table.CURVE} / move_base" if column == 0 else "")
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=DOTS_PER_INCH)
    plt.close(figure)
