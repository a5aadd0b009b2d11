"""How a scenario is run, and what comes of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from terrain.recording.recording import Recording
from terrain.recording.verdict import Verdict
from terrain.session.executives import GoalExecutive
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session, SessionOptions

Metrics = dict[str, Any]
Watch = Callable[[Session, GoalSequence], AbstractContextManager[object]]
WriteViews = Callable[[Path, Recording, Metrics], Sequence[str]]
WriteJointViews = Callable[[Path, Mapping[str, Recording], Verdict], Sequence[str]]


@dataclass(frozen=True)
class Progress:
    """State of a run in progress; times in seconds, distance in metres, tilt in radians."""

    time: float
    wall_time: float
    distance_left: float
    speed: float
    tilt: float
    state: str


@dataclass(frozen=True)
class RunResult:
    """Result of a run; ``metrics`` holds the contents of metrics.json and timing.json."""

    verdict: Verdict
    folder: Path
    metrics: dict[str, Any] = field(repr=False)

    @property
    def success(self) -> bool:
        """Whether the run has succeeded, see ``terrain.recording.verdict``."""
        return self.verdict.success


@dataclass(frozen=True)
class RunOptions(SessionOptions):
    """How a scenario is run; results go to ``folder``.

    Attributes
    ----------
    command : str
        The command line that asked for the run, as it is recorded; empty for a run of a script.
    executive : str
        Who decides on plans, drives and recoveries, a name of ``terrain.session.executives.EXECUTIVES``, or as it is
        recorded of a run with ``outside``.
    outside : callable, optional
        Makes what visits the goals of a session instead of an executive of that name, where somebody outside drives.
    geodesic : bool
        Measure the shortest path over the ground too, which takes up to about a second, and the SPL.
    stay : bool
        Wait for further goals after those of the scenario, see ``GoalSequence.go_to``.
    watch : callable
        Returns a context manager for a session and its goals, in which the run takes place, e.g. to serve a page.
    write_views : callable
        Writes views (pictures, pages) from the folder, the recording and the metrics; returns problems.
    write_joint_views : callable
        The same of several robots together, from the folder, the recording of each by its name, and the verdict on all.
    on_progress : callable
        Called about ten times a simulated second.
    on_note : callable
        Called with what the user must know, such as a package that is missing to draw.
    """

    folder: Path
    command: str = ""
    executive: str = "move_base"
    outside: Callable[[Session], GoalExecutive] | None = None
    geodesic: bool = False
    stay: bool = False
    watch: Watch = lambda session, goals: nullcontext()
    write_views: WriteViews = lambda folder, recording, metrics: ()
    write_joint_views: WriteJointViews = lambda folder, recordings, verdict: ()
    on_progress: Callable[[Progress], None] = lambda progress: None
    on_note: Callable[[str], None] = lambda text: None
