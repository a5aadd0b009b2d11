"""How near the robot must come to the end of a path that does not reach its target."""

from __future__ import annotations

LEAST_SHARE_LEFT = 0.25
"""Of the tolerance, for stopping at the end of a path that does not reach the target."""


def tolerance_left(tolerance: float, off: float) -> float | None:
    """What a path that ends ``off`` [m] its target leaves of the arrival tolerance [m]; None = all of it."""
    if off == 0.0 or tolerance == 0.0:
        return None
    return max(tolerance - off, LEAST_SHARE_LEFT * tolerance)
