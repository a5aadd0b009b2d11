"""Metrics in words and with their units, as pages and tables show them; files keep the keys."""

from __future__ import annotations

UNITS = {"m": "m", "s": "s", "ms": "ms", "deg": "°", "j": "J", "percent": "%"}
WORDS = {
    "spl": "SPL",
    "path_length_m": "driven length [m]",
    "geodesic_m": "shortest path [m]",
    "path_over_geodesic": "length / shortest",
    "mean_speed": "mean speed [m/s]",
    "mean_command_acceleration": "mean change of commanded speed [m/s²]",
    "mean_command_yaw_acceleration": "mean change of commanded yaw rate [rad/s²]",
    "clearance_min_m": "least clearance [m]",
    "clearance_median_m": "median clearance [m]",
    "planning_time_median_s": "simulated planning time, median [s]",
    "planning_time_p95_s": "simulated planning time, 95 % [s]",
    "planning_wall_median_ms": "planning time, median [ms]",
    "planning_wall_p95_ms": "planning time, 95 % [ms]",
    "planning_wall_max_ms": "planning time, longest [ms]",
    "arrival_tolerance": "arrival tolerance [m, °]",
    "tip_overs": "tip-overs",
    "success_percent": "success [%]",
    "arrived_with_failures": "arrived, but failed",
    "median_time_s": "time [s]",
    "median_length_m": "length [m]",
    "median_path_over_geodesic": "length / shortest",
    "median_clearance_m": "clearance [m]",
    "mean_spl": "mean SPL",
    "low_95": "95 % from",
    "high_95": "to",
    "p_holm": "p (Holm)",
}


def in_words(key: str) -> str:
    """Return the name of a metric for a reader: ``max_tilt_deg`` is ``max tilt [°]``; a name in words stays.

    >>> in_words("distance_to_goal_m"), in_words("time [s]")
    ('distance to goal [m]', 'time [s]')
    """
    if key in WORDS or "_" not in key:
        return WORDS.get(key, key)
    first, _, last = key.rpartition("_")
    words = f"{first} [{UNITS[last]}]" if last in UNITS else key
    return words.replace("_", " ")
