"""What a run must not do even if it arrives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mbf_abstract.parameters import ParameterModel, parameter
from terrain.physics.incidents import IncidentKind


class Limits(ParameterModel):
    """Limits of a run; one that breaks any of them has failed, wherever it ended."""

    max_tilt: float | None = parameter(None, "Largest tilt of the robot.", unit="deg", gt=0.0)
    max_path_length: float | None = parameter(None, "Longest track.", unit="m", gt=0.0)
    goal_distance: float | None = parameter(
        None,
        "Largest true distance to a goal that navigation reports as reached; absent = the navigation's tolerance and "
        "three standard deviations of the pose.",
        unit="m",
        gt=0.0,
        le=1000.0,
    )
    goal_angle: float | None = parameter(
        None, "Largest true angle to it; absent likewise.", unit="deg", gt=0.0, le=180.0
    )
    forbidden: tuple[IncidentKind, ...] = parameter((), "Incidents that must not happen.")


def broken_limits(limits: Limits, metrics: Mapping[str, Any]) -> list[str]:
    """Name every limit that the metrics of a run break."""
    broken = []
    for name, limit, unit in (
        ("max_tilt_deg", limits.max_tilt, "degrees"),
        ("path_length_m", limits.max_path_length, "m"),
    ):
        if limit is not None and metrics[name] > limit:
            broken.append(f"{name} {metrics[name]:.1f} is above {limit:g} {unit}")
    forbidden = {kind.value for kind in limits.forbidden}
    return broken + [f"{incident} happened" for incident in metrics["incidents"] if incident in forbidden]
