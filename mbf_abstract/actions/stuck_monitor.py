"""Detects a stuck robot: the same failure at the same place, again and again, whatever recovery is tried.

An executive notes every failure it recovers from and every behaviour it has run. Where failures of one kind have come
``stuck_failures`` times within ``stuck_distance`` of a place, and go on after ``stuck_time``, the robot is stuck there:
the monitor emits an event, and the behaviours of ``escalation_behaviors`` are due, one after the other. Each runs once
at a place; then there is nothing left to try, and ``described`` gives the text with which the executive gives up.

Where a robot is blocked and meets robots that announce their paths (``mbf_abstract.traffic``), the behaviour for
``meetings`` is due at the first failure: what clears maps or backs up takes time, and the others do not know of it. It
runs ``MOST_MEETINGS`` times at a place at most.

Between two ways that each look free from before the other one a robot drives to and fro, and nothing fails. So who
replaces a path that is driven notes that, too, and a setback that comes so often at one place is a failure.

When to use: one monitor for each goal of an executive of your own; ``move_base`` and the missions of behaviour trees
have one. When not: for a robot that gets nowhere along one path; ``exe_path`` watches its oscillation and progress.

A place at which the ground is steeper than planned, or the wheels find no hold, is closed on the maps as soon as a
recovery has led the robot away from it, so that the next plan leads around (``maps.avoided_places``). So is a place at
which the robot is stuck because it got nowhere. An executive whose goal is over calls ``finish``.

Places are kept until the goal ends, so a robot that is sent to and fro between two closed doors is found, too. What
counts is where a failure was met, not what the robot did in between; a plan that succeeds is no progress.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from mbf_abstract.actions.meetings import BLOCKED, behavior_for_meetings, meets_others
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import EventKind
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose
from mbf_abstract.maps.avoided_places import AvoidedPlace, AvoidedPlaces
from mbf_abstract.outcomes import (
    ExePathOutcome,
    GetPathOutcome,
    MoveBaseOutcome,
    RecoveryOutcome,
    is_success,
    outcome_name,
)
from mbf_abstract.server.plugin_table import PluginTable
from mbf_abstract.time.clock import TIME_RESOLUTION

SETBACK = 1.0
"""A new path is a setback if it is longer by more than this [m] than what was left of the one before."""
MOST_MEETINGS = 5
"""How often the right of way is asked for at one place."""
NO_PLAN = frozenset([GetPathOutcome.NO_PATH_FOUND, GetPathOutcome.BLOCKED_GOAL])
"""Failures that closed places may be to blame for."""
SAME_KIND: dict[int, int] = {ExePathOutcome.COLLISION: ExePathOutcome.BLOCKED_PATH}
"""Failures that count as others: whether a blocked robot touches what is in its way may change by a centimetre."""
NOWHERE = frozenset([ExePathOutcome.OSCILLATION, MoveBaseOutcome.OSCILLATION])
"""Failures of a robot that drives and gets nowhere."""
FAULTY = frozenset([RecoveryOutcome.INTERNAL_ERROR, RecoveryOutcome.PAT_EXCEEDED])
"""How behaviours end that raise, answer something else, or do not come back."""


@dataclass
class TroubleSpot:
    """A place where something failed, for one goal.

    Attributes
    ----------
    place : Pose
        Where the robot was at the first failure.
    failures : dict of int to list of float
        Times [s] of the failures of each outcome code; of those of one kind, ``SAME_KIND``, together.
    tried : dict of str to int
        Behaviours that ran here, with their last outcome, in the order of their first run.
    escalations : int
        How many behaviours of the escalation are used up here.
    meetings : int
        How often the right of way was asked for here.
    """

    place: Pose
    failures: dict[int, list[float]] = field(default_factory=dict)
    tried: dict[str, int] = field(default_factory=dict)
    escalations: int = 0
    meetings: int = 0

    def __str__(self) -> str:
        x, y, z = self.place.position
        where = f"({x:.2f}, {y:.2f})" if z == 0.0 else f"({x:.2f}, {y:.2f}, {z:.2f})"
        outcome = max(self.failures, key=lambda code: len(self.failures[code]))
        count = len(self.failures[outcome])
        return f"stuck at {where}: {outcome_name(outcome)} {count} times; {self.attempts}"

    @property
    def attempts(self) -> str:
        """What was tried here, and how it ended where that was no success."""
        ends = [name if is_success(end) else f"{name} ({outcome_name(end)})" for name, end in self.tried.items()]
        return f"tried {', '.join(ends) or 'nothing'}"


class StuckMonitor:
    """The trouble of one goal at a time; used by one thread."""

    def __init__(self, runtime: Runtime, plugins: PluginTable) -> None:
        self._runtime, self._plugins = runtime, plugins
        self._avoided = AvoidedPlaces(runtime.map_hooks.avoid)
        self.restart()

    def restart(self, escalation: Sequence[str] = ()) -> None:
        """Forget everything for a new goal.

        Parameters
        ----------
        escalation : sequence of str
            Recovery behaviours for a robot that is stuck, in their order; without any the monitor only reports.
        """
        self._escalation = tuple(escalation)
        self._spots: list[TroubleSpot] = []
        self._setbacks: list[Pose] = []
        self._present: TroubleSpot | None = None
        self._for_meeting = ""  # the behaviour that is due because the robot meets others
        self._avoided.forget()

    def finish(self) -> None:
        """Open all places that were closed; the goal is over."""
        self._avoided.forget()

    # ------------------------------------------------------------------------------------------- what happened
    def note_failure(self, outcome: int) -> None:
        """Count a failure where the robot is now; one of a robot that does not know where it is belongs nowhere."""
        self._for_meeting = ""
        try:
            pose = self._runtime.robot.pose()
        except RobotStateError:
            self._present = None
            return
        self._present = spot = self._spot_at(pose)
        failures = spot.failures.setdefault(SAME_KIND.get(outcome, outcome), [])
        was_stuck = self._is_too_much(failures)
        failures.append(self._runtime.clock.now())
        if outcome in BLOCKED and spot.meetings < MOST_MEETINGS and meets_others(self._runtime, self._plugins):
            self._for_meeting = behavior_for_meetings(self._runtime, self._plugins)
        is_stuck = self._is_too_much(failures)
        self._avoid_or_open(pose, outcome, is_stuck)
        if is_stuck and not was_stuck:
            self._runtime.events.emit(
                EventKind.STUCK,
                "stuck_monitor",
                place=list(spot.place.position),
                outcome=int(outcome),
                failures=len(failures),
                tried=list(spot.tried),
                message=str(spot),
            )

    def note_new_path(self, length: float, rest: float) -> str:
        """Note that a path would replace the ``rest`` [m] of the one that is driven; why that is a setback too many."""
        limits, count = self._runtime.parameters, 0
        with suppress(RobotStateError):
            if length > rest + SETBACK:
                self._setbacks.append(here := self._runtime.robot.pose())
                count = sum(place.distance_to(here) <= limits.stuck_distance for place in self._setbacks)
        too_many = 0 < limits.stuck_failures <= count
        return f"{count} times at this place a path was to be given up for one that is longer" if too_many else ""

    def _avoid_or_open(self, pose: Pose, outcome: int, is_stuck: bool) -> None:
        """Note a place that is worse than the map says; open all again where no plan is left."""
        if outcome == ExePathOutcome.ROBOT_STUCK or (is_stuck and outcome in NOWHERE):
            self._avoided.note(pose, self._runtime.parameters.stuck_distance)
        elif outcome in NO_PLAN and self._avoided.open_all():
            self._report_avoided(())
        elif outcome == GetPathOutcome.BLOCKED_START:  # perhaps the robot has slid onto a closed place
            self._avoid_those_left(pose)

    def _is_too_much(self, times: Sequence[float]) -> bool:
        """Whether failures of one kind at one place, at these times [s], mean that the robot is stuck."""
        parameters = self._runtime.parameters
        enough = 0 < parameters.stuck_failures <= len(times)
        return enough and times[-1] - times[0] >= parameters.stuck_time - TIME_RESOLUTION

    def _spot_at(self, pose: Pose) -> TroubleSpot:
        """Return the oldest place within the distance, else a new one."""
        distance = self._runtime.parameters.stuck_distance
        for spot in self._spots:
            if spot.place.distance_to(pose) <= distance:
                return spot
        self._spots.append(TroubleSpot(pose))
        return self._spots[-1]

    def note_recovery(self, behavior: str, outcome: int) -> bool:
        """Note that a behaviour has run against the last failure, and its end; close the places it led away from.

        Returns
        -------
        bool
            Whether plans avoid more places than before.
        """
        if self._present is not None:
            self._present.tried[behavior] = outcome
        before = len(self._avoided.closed)
        with suppress(RobotStateError):
            self._avoid_those_left(self._runtime.robot.pose())
        return len(self._avoided.closed) > before

    def _avoid_those_left(self, pose: Pose) -> None:
        """Close the places that a robot at a pose does not stand on, and no others."""
        before = self._avoided.closed
        now = self._avoided.close_those_left(pose)
        if now != before:
            self._report_avoided(now)

    def _report_avoided(self, places: Sequence[AvoidedPlace]) -> None:
        """Put into the log which places plans avoid from now on."""
        centres = [list(place.centre.position) for place in places]
        text = f"plans avoid {len(centres)} place(s) at which the robot was stuck" if centres else "no place is avoided"
        self._runtime.events.emit(EventKind.CUSTOM, "stuck_monitor", message=text, places=centres)

    # --------------------------------------------------------------------------------------------- what is due
    @property
    def stuck(self) -> bool:
        """Whether the last failure was one too many at its place."""
        return self._present is not None and any(map(self._is_too_much, self._present.failures.values()))

    @property
    def escalates(self) -> bool:
        """Whether right of way or escalation decide what happens next, instead of the usual recoveries."""
        return bool(self._for_meeting) or (self.stuck and bool(self._escalation))

    def next_behavior(self) -> str:
        """Return the one for the right of way, if it is due, else the next one of the escalation at the present place.

        Empty if all have run here.
        """
        spot = self._present
        if spot is not None and self._for_meeting:
            behavior, self._for_meeting = self._for_meeting, ""
            spot.meetings += 1
            return behavior
        if spot is None or spot.escalations >= len(self._escalation):
            return ""
        spot.escalations += 1
        return self._escalation[spot.escalations - 1]

    def described(self, message: str) -> str:
        """Return the message of a failure, with place and attempts of a robot that is stuck, or attempts at fault."""
        if (spot := self._present) is None:
            return message
        if self.stuck:
            return f"{message}; {spot}"
        return message if FAULTY.isdisjoint(spot.tried.values()) else f"{message}; {spot.attempts}"
