"""Speed, tilt and cost over the last two minutes, as small plots in the page."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain.viewer.pictures.colours import DRIVEN, PLANNED, SLOPE_COLOURS, Colour

PERIOD = 0.2  # s of simulated time between two samples
UNWATCHED_PERIOD = 1.0  # s, without visitors
LENGTH = 600  # samples: two minutes
HEIGHT = 110  # pixels


class History:
    """The newest samples of what is plotted: time [s], speed [m/s], tilt [degrees], cost (the map's own unit)."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float, float, float]] = deque(maxlen=LENGTH)

    def is_due(self, time: float, period: float = PERIOD) -> bool:
        """Whether the last sample is ``period`` s ago."""
        return not self._samples or time >= self._samples[-1][0] + period - 1e-9

    def add(self, time: float, speed: float, tilt: float, cost: float) -> None:
        """Keep a sample."""
        self._samples.append((time, speed, tilt, cost))

    def columns(self) -> NDArray[np.float64]:
        """(4, n) float64."""
        return np.array(self._samples, dtype=np.float64).reshape(-1, 4).T


class Plots:
    """Three plots that are fed from a history."""

    def __init__(self, gui: Any) -> None:
        steep: Colour = tuple(int(channel) for channel in SLOPE_COLOURS[3])  # type: ignore[assignment]
        self._charts = [
            _chart(gui, "speed [m/s]", PLANNED),
            _chart(gui, "tilt [°]", steep),
            _chart(gui, "cost under the robot", DRIVEN),
        ]

    def show(self, history: History) -> None:
        """Draw what the history holds."""
        time, *series = history.columns()
        if len(time) < 2:
            return
        for chart, values in zip(self._charts, series, strict=True):
            chart.data = (time, values)


def _chart(gui: Any, title: str, colour: Colour) -> Any:
    red, green, blue = colour
    stroke = f"rgb({red},{green},{blue})"
    return gui.add_uplot(
        (np.array([0.0, 1.0]), np.array([0.0, 0.0])),
        ({"label": "t"}, {"label": title, "stroke": stroke, "width": 2}),
        title=title,
        scales={"x": {"time": False}, "y": {"auto": True}},
        legend={"show": False},
        height=HEIGHT,
    )
