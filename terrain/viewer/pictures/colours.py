"""The colours of pictures and replays, in one place, so that a plan is the same blue everywhere. sRGB, 0 to 255.

Slopes go from grass green over ochre to brick red; the ramp stays readable with the common kinds of colour blindness
because its lightness falls all the way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain.recording.verdict import Level

Colour = tuple[int, int, int]

PLANNED: Colour = (25, 90, 220)
DRIVEN: Colour = (225, 85, 10)
START: Colour = (30, 140, 60)
GOAL: Colour = (200, 20, 80)
WALL: Colour = (66, 72, 84)
LIT_WALL: Colour = (142, 150, 164)
"""Walls of the replay, which its light darkens."""
OBSTACLE: Colour = (196, 140, 60)
FLOOR: Colour = (222, 220, 212)
SCAN: Colour = (220, 30, 40)
BODY: Colour = (245, 190, 40)
WHEEL: Colour = (40, 40, 44)
FLEET: tuple[Colour, ...] = (DRIVEN, (20, 120, 200), (40, 150, 70), (160, 60, 170), (150, 110, 30), (200, 50, 110))
"""Tracks of several robots; a seventh one begins anew."""
ACTORS: dict[str, Colour] = {"person": (150, 60, 190), "door": (120, 90, 60), "robot": (0, 140, 160)}
TRACKED: Colour = (0, 205, 235)
"""What the robot knows of things that move; what they are in truth has the colours of ``ACTORS``."""

GOOD, WARNING, BAD, NEITHER = "#1a7f37", "#9a6700", "#cf222e", "#6b7280"  # of texts, as CSS has them
LEVELS = {Level.SUCCESS: GOOD, Level.ARRIVED: WARNING, Level.FAILED: BAD}

SLOPE_STOPS = np.array([0.0, 10.0, 20.0, 30.0, 45.0])  # degrees
SLOPE_COLOURS = np.array(
    [(196, 214, 160), (164, 186, 112), (205, 170, 95), (178, 104, 62), (120, 40, 40)], dtype=np.float64
)


def slope_colours(slopes: ArrayLike) -> NDArray[np.float64]:
    """Colours (n, 3) float64 0..255 of slopes [degrees] (n,)."""
    slopes = np.asarray(slopes, dtype=np.float64)
    return np.stack([np.interp(slopes, SLOPE_STOPS, channel) for channel in SLOPE_COLOURS.T], axis=-1)


def slope_legend() -> list[tuple[str, Colour]]:
    """Labels and colours for a legend of slopes."""
    return [
        (f"{stop:.0f}°", (int(red), int(green), int(blue)))
        for stop, (red, green, blue) in zip(SLOPE_STOPS, SLOPE_COLOURS, strict=True)
    ]


def cost_ramp(levels: ArrayLike) -> NDArray[np.float64]:
    """Colours (n, 3) float64 0..255 of costs (n,) between free (0) and the highest there is (1); inf is forbidden."""
    levels = np.asarray(levels, dtype=np.float64)
    stops = np.linspace(0.0, 1.0, len(SLOPE_COLOURS))
    colours = np.stack([np.interp(levels, stops, channel) for channel in SLOPE_COLOURS.T], axis=-1)
    colours[np.isinf(levels)] = WALL
    return colours


def cost_colours_up_to(top: float, costs: ArrayLike) -> NDArray[np.uint8]:
    """Colours (n, 3) of costs (n,) on the ramp from 0 to ``top``; inf is forbidden."""
    return np.round(cost_ramp(np.asarray(costs, dtype=np.float64) / top)).astype(np.uint8)


def linear_for_viewer(colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Vertex colours (n, 3) as glTF wants them: linear light; sRGB values look washed out there."""
    return np.asarray(np.round((colours / 255.0) ** 2.2 * 255.0), dtype=np.uint8)
