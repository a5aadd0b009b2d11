"""What limits of speed mean, for the layers of every map that state some."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

LimitType = Literal["absolute", "percent"]


def lowest(limits: Iterable[float], limit_type: LimitType, full_speed: float) -> float:
    """The lowest of limits in m/s, or in % of ``full_speed`` [m/s], and ``full_speed`` where there is none.

    A share of a speed that is not known, inf, is no limit, unless it is 0 %.
    """
    least = min(limits, default=math.inf)
    if limit_type == "percent" and least < math.inf:
        least = least * full_speed / 100.0 if least > 0.0 else 0.0
    return min(full_speed, least)


def limit_warning(limit: float, limit_type: LimitType) -> str:
    """Why a limit in m/s, or in % of the full speed, slows nobody down; empty if it does."""
    is_all = limit_type == "percent" and limit >= 100.0
    return f"a speed_limit of {limit:g} percent is no limit" if is_all else ""
