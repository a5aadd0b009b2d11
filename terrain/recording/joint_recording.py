"""The recordings of several robots of one run, to be shown together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mbf_abstract.events import Event, EventKind
from terrain.recording.recording import Recording
from terrain.recording.verdict import Verdict


class JointRecording:
    """Several robots that moved in one world at the same time.

    Parameters
    ----------
    robots : mapping of str to Recording
        By name, in the order of the scenario. The last actors of each are the other robots.
    verdict : Verdict
        On all of them.

    Attributes
    ----------
    world : Recording
        The first one, with the goals and the positions of all robots, and with actors that are none of them; for what
        does not belong to one robot.
    """

    def __init__(self, robots: Mapping[str, Recording], verdict: Verdict) -> None:
        first = next(iter(robots.values()))
        self.robots = dict(robots)
        self.world = replace(
            first,
            scenario=first.scenario.partition("/")[0],
            goals=tuple(goal for recording in robots.values() for goal in recording.goals),
            poses=np.concatenate([recording.poses for recording in robots.values()]),
            actors=first.actors[: len(first.actors) - len(robots) + 1],
            events=joint_events(robots),
            verdict=verdict,
        )


def joint_events(robots: Mapping[str, Recording]) -> tuple[Event, ...]:
    """Events of all robots in order of time, each robot's name before its sources; without those of trees."""
    events = [
        replace(event, source=f"{name}/{event.source}")
        for name, recording in robots.items()
        for event in recording.events
        if event.kind is not EventKind.TREE
    ]
    return tuple(sorted(events, key=lambda event: event.time))
