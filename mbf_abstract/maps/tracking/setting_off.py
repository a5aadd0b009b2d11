"""When somebody who stood moves again for the guard that stops the robot before contact.

That they have come ``moving_distance`` shows for sure that they moved. To wait for it would be too late where somebody
comes out from behind a corner, goes on after a wait, or sets off after they have loaded. So their estimated speed shows
it, if it would take them that far in ``standing_time``. What the robot has known for longer than that and never saw
move, such as a shelf, is likely to stand. It must have come a part of that distance, too (decision 0124).

When to use: for the guard, which only brakes. When not: costs, plans and texts, for which the distance counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from mbf_abstract.maps.tracking.kernels import filtering as states_of

SETTING_OFF = 0.4
"""Part of ``moving_distance``. With less, noise of the robot's pose makes shelves move; with more it is seen late."""


def unnoticed_speed(moving_distance: float, standing_time: float) -> float:
    """Speed [m/s] below which somebody stands who comes less than a distance [m] in a time [s]."""
    return moving_distance / standing_time


def seems_to_move(state: Sequence[float], now: float, moving_distance: float, standing_time: float) -> bool:
    """Whether an object is fast enough to be moving at ``now`` [s], and has come far enough for it.

    Parameters
    ----------
    state : (STATE_COLUMNS,) sequence of float
        Its row in the tracker.
    """
    vx, vy = state[states_of.VX], state[states_of.VY]
    speed = hypot(vx, vy)
    if speed < unnoticed_speed(moving_distance, standing_time):
        return False
    if state[states_of.HAS_MOVED] or now - state[states_of.FIRST_SEEN] <= standing_time:
        return True
    dx, dy = state[states_of.X] - state[states_of.ANCHOR_X], state[states_of.Y] - state[states_of.ANCHOR_Y]
    return vx * dx + vy * dy >= SETTING_OFF * moving_distance * speed
