"""Whether a robot has arrived, by its true pose and not by the estimated one.

Navigation ends a goal by the pose of the localisation. If that is wrong, navigation reports the goal as reached while
the robot stands elsewhere; such a run has not succeeded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.tangent_plane import heading_error
from mbf_abstract.goals.result_types import MoveBaseResult
from terrain.scenarios.limits import Limits
from terrain.scenarios.noise import LocalizationNoise

DEVIATIONS = 3.0  # standard deviations of the estimated pose that a robot may be off


@dataclass(frozen=True)
class Arrival:
    """Where the robot was when navigation reported a goal as reached.

    Attributes
    ----------
    distance_m, angle_deg : float
        From the goal in truth; the angle is what the robot would have to turn, on a slope as its controller sees it.
    estimated_distance_m, estimated_angle_deg : float
        The same by the pose that the localisation estimated.
    """

    distance_m: float
    angle_deg: float
    estimated_distance_m: float
    estimated_angle_deg: float

    @classmethod
    def at(cls, goal: Pose, truth: Pose, result: MoveBaseResult) -> Arrival:
        """Compare the true pose and the one in navigation's result with the goal."""
        estimate = result.final_pose
        return cls(
            truth.distance_to(goal),
            abs(math.degrees(heading_error(truth, goal))),
            result.dist_to_goal,
            math.inf if estimate is None else abs(math.degrees(heading_error(estimate, goal))),
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain values, rounded to micrometres and microdegrees; what is not known is None."""
        return {key: round(value, 6) if math.isfinite(value) else None for key, value in asdict(self).items()}


def arrival_tolerance(
    limits: Limits, noise: LocalizationNoise, parameters: NavigationParameters
) -> tuple[float, float]:
    """Largest true distance [m] and angle [deg] from a goal that count as an arrival.

    The scenario's limits, or else the tolerances of the navigation widened by three standard deviations of the pose.
    """
    distance = parameters.dist_tolerance + DEVIATIONS * math.hypot(noise.position_noise, noise.height_noise)
    angle = math.degrees(parameters.angle_tolerance) + DEVIATIONS * noise.yaw_noise
    return (
        distance if limits.goal_distance is None else limits.goal_distance,
        angle if limits.goal_angle is None else limits.goal_angle,
    )


def missed_goals(metrics: Mapping[str, Any]) -> list[str]:
    """Name every goal that navigation reported as reached and that was missed in truth."""
    distance, angle = metrics["arrival_tolerance"]
    missed = []
    for number, arrival in enumerate(metrics["arrivals"], 1):
        if arrival["distance_m"] > distance:
            missed.append(
                f"goal {number} was missed by {arrival['distance_m']:.2f} m in truth, "
                f"allowed are {distance:.2f} m{_estimate(arrival['estimated_distance_m'], 'm')}"
            )
        elif arrival["angle_deg"] > angle:
            missed.append(
                f"goal {number} was missed by {arrival['angle_deg']:.0f} degrees in truth, "
                f"allowed are {angle:.0f}{_estimate(arrival['estimated_angle_deg'], 'degrees')}"
            )
    return missed


def _estimate(value: float | None, unit: str) -> str:
    return "" if value is None else f" (estimated {value:.2f} {unit})"
