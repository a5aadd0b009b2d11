"""Results of the actions: a code, a text, and what was planned or driven; the fields are those of ``mbf_msgs``."""

from __future__ import annotations

from dataclasses import dataclass

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.outcomes import GetPathOutcome, is_success, outcome_name


@dataclass(frozen=True)
class ActionResult:
    """What every result has: an outcome code (success < 10) and a text that is never empty."""

    outcome: int
    message: str

    def __post_init__(self) -> None:
        if not self.message:
            object.__setattr__(self, "message", outcome_name(self.outcome))

    @property
    def success(self) -> bool:
        """Whether the outcome is below 10."""
        return is_success(self.outcome)

    @property
    def outcome_name(self) -> str:
        """Readable name of the outcome."""
        return outcome_name(self.outcome)


@dataclass(frozen=True)
class GetPathResult(ActionResult):
    """Path in the global frame and its cost (the path's length where the planner gives none).

    ``plugin_outcome`` and ``plugin_message`` are the planner's last result, also where patience ran out.
    ``permanent`` says of a failure that planning anew, from the same start, cannot change it.
    """

    path: Path | None = None
    cost: float = 0.0
    planner: str = ""
    plugin_outcome: int | None = None
    plugin_message: str = ""
    permanent: bool = False

    @property
    def is_final(self) -> bool:
        """Whether nothing changes a failure: a recovery moves a robot off a blocked start, but opens no walls."""
        return self.permanent and self.outcome != GetPathOutcome.BLOCKED_START


@dataclass(frozen=True)
class ExePathResult(ActionResult):
    """Where the robot ended, and how far [m, rad] from the last pose of the path."""

    final_pose: Pose | None = None
    dist_to_goal: float = float("inf")
    angle_to_goal: float = float("inf")
    controller: str = ""
    plugin_outcome: int | None = None
    plugin_message: str = ""


@dataclass(frozen=True)
class RecoveryResultMessage(ActionResult):
    """The behaviour that ran."""

    used_plugin: str = ""


@dataclass(frozen=True)
class RefinePathResult(ActionResult):
    """The refined path, how far its end moved, and its length divided by the original's.

    Without success ``refined_path`` is the path of the goal: it can be driven, as it could before.
    """

    refined_path: Path | None = None
    final_position_error: float = 0.0
    final_orientation_error: float = 0.0
    path_length_ratio: float = 1.0
    refiner: str = ""


@dataclass(frozen=True)
class MoveBaseResult(ActionResult):
    """Where the robot ended, and how far [m, rad] from the target."""

    final_pose: Pose | None = None
    dist_to_goal: float = float("inf")
    angle_to_goal: float = float("inf")


@dataclass(frozen=True)
class FollowWaypointsResult(ActionResult):
    """Result of a waypoint sequence: one result per visit, in order of visits.

    The outcome is SUCCESS if every visit succeeded, else that of the first one that failed; CANCELED and INTERNAL_ERROR
    are those of the sequence.
    """

    results: tuple[MoveBaseResult, ...] = ()

    @property
    def failed(self) -> tuple[int, ...]:
        """Numbers of the visits that failed."""
        return tuple(number for number, result in enumerate(self.results) if not result.success)
