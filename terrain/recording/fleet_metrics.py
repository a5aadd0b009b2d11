"""The numbers and the verdict of several robots together, from those of each.

Distances, energy and counts are sums, the time is that of the robot that needed longest, extremes are those of all. A
contact of two robots counts once, however often its two monitors report it, with those of the two that moved.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from terrain.physics.encounters import Mover
from terrain.physics.incidents import COLLISIONS_WITH, Incident
from terrain.physics.motion_sample import Thing
from terrain.recording.verdict import Level, Verdict

SUMMED = (
    *("path_length_m", "planned_length_m", "climb_m", "stops", "plans", "planner_calls", "control_cycles"),
    *("failed_control_cycles", "recoveries", "gate_stops", "faults", "collisions", "collisions_while_moving"),
    *("tip_overs", "near_misses", "energy_j", "slipped_m"),
)
LARGEST = ("time_s", "max_tilt_deg", "max_roll_deg", "max_pitch_deg")
MEANS = ("spl",)
ONE_CONTACT = 1.0
"""Reports of a contact of the same two robots within this time [s] are one contact."""


class Report(NamedTuple):
    """What the monitor of the robot ``name`` says of a contact at ``stamp`` [s]: with whom, and who moved."""

    stamp: float
    name: str
    other: str
    moved: Mover | None


def together(
    scenario: str, metrics: Mapping[str, Mapping[str, Any]], contacts: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the contents of ``metrics.json`` of a run with several robots, without the verdict.

    Parameters
    ----------
    metrics : mapping of str to mapping
        Of each robot, by its name.
    contacts : sequence of mapping
        What ``contacts_between`` has found.
    """
    every = list(metrics.values())
    joint: dict[str, Any] = {"scenario": scenario, "backend": " ".join(sorted({one["backend"] for one in every}))}
    joint |= {name: round(sum(one[name] for one in every), 6) for name in SUMMED}
    joint |= {name: max(one[name] for one in every) for name in LARGEST}
    for name in MEANS:
        if all(one.get(name) is not None for one in every):
            joint[name] = round(sum(one[name] for one in every) / len(every), 6)
    clearances = [one["clearance_min_m"] for one in every if one["clearance_min_m"] is not None]
    joint["clearance_min_m"] = min(clearances, default=None)
    joint["incidents"] = sorted({incident for one in every for incident in one["incidents"]})
    joint["contacts_between_robots"] = list(contacts)
    digests = "".join(f"{name} {one['digest']}\n" for name, one in metrics.items())
    joint["digest"] = hashlib.sha256(digests.encode()).hexdigest()
    joint["robots"] = {name: dict(one) for name, one in metrics.items()}
    return joint


def contacts_between(incidents: Mapping[str, Sequence[Incident]]) -> list[dict[str, Any]]:
    """Return the contacts of robots with each other, from what the monitor of each has found.

    Returns
    -------
    list of dict
        In order of time: ``time`` [s], ``robots``, two names in order, and ``moved``, those that moved by themselves.
    """
    reports = [
        Report(incident.stamp, name, incident.other.name, incident.moved)
        for name, of_one in incidents.items()
        for incident in of_one
        if incident.kind is COLLISIONS_WITH[Thing.ROBOT]
        and incident.other is not None
        and incident.other.name in incidents
    ]
    episodes: list[list[Report]] = []
    newest: dict[tuple[str, str], list[Report]] = {}
    for report in sorted(reports, key=lambda report: report[:3]):
        pair = _pair(report)
        if pair not in newest or report.stamp - newest[pair][-1].stamp > ONE_CONTACT:
            newest[pair] = []
            episodes.append(newest[pair])
        newest[pair].append(report)
    return [
        {"time": round(reports[0].stamp, 6), "robots": list(_pair(reports[0])), "moved": _moved(reports)}
        for reports in episodes
    ]


def _pair(report: Report) -> tuple[str, str]:
    first, second = sorted((report.name, report.other))
    return first, second


def _moved(reports: Sequence[Report]) -> list[str]:
    """Who of two robots moved by itself in a contact; what a robot says of itself counts before what the other saw."""
    of_itself = {report.name for report in reports}
    moved = {report.name for report in reports if report.moved in (Mover.ROBOT, Mover.BOTH)}
    seen = {report.other for report in reports if report.moved in (Mover.OTHER, Mover.BOTH)}
    return sorted(moved | (seen - of_itself))


def judge_together(verdicts: Mapping[str, Verdict]) -> Verdict:
    """Return the verdict on all robots: a success if that of each is one.

    The outcome is that of the first robot that did not arrive, 0 where all did.
    """
    good = sum(verdict.success for verdict in verdicts.values())
    failed = [(name, verdict) for name, verdict in verdicts.items() if verdict.level is Level.FAILED]
    texts = [f"{good} of {len(verdicts)} robots succeeded", *(f"{name}: {v.message}" for name, v in failed)]
    failures = tuple(f"{name}: {failure}" for name, verdict in verdicts.items() for failure in verdict.failures)
    outcomes = [verdict.outcome for _, verdict in failed]
    return Verdict(
        outcomes[0] if outcomes else 0, "; ".join(texts), failures, all(v.at_goals for v in verdicts.values())
    )
