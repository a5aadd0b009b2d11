"""Goals, results and feedback of the actions, with the fields of ``mbf_msgs``.

An empty plugin name means the first one loaded (for a running ``exe_path``: the running one). All values are frozen;
a goal object can be sent any number of times.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mbf_abstract.geometry import Command, Path, Pose
from mbf_abstract.goals.goal_area import GoalArea
from mbf_abstract.outcomes import is_success, outcome_name

WaypointTask = Callable[[int, Pose], None]
"""What is done at a waypoint, called with its index and pose."""


@dataclass(frozen=True)
class GetPathGoal:
    """Ask for a path.

    Attributes
    ----------
    start_pose : Pose, optional
        None = from where the robot is.
    dist_tolerance, angle_tolerance : float, optional
        How far [m, rad] from the target the path may end where the target itself cannot be reached; 0 = exactly there,
        None = the server's tolerances (with a ``goal_area`` 0: the area is tolerance enough).
    via : tuple of Pose
        Poses to pass between start and target, in order.
    goal_area : GoalArea, optional
        Any place inside counts as reached; ``target_pose`` is then ignored.
    concurrency_slot : int
        0..255; goals in different slots run in parallel, a new goal in a used slot preempts.
    """

    target_pose: Pose
    start_pose: Pose | None = None
    planner: str = ""
    dist_tolerance: float | None = None
    angle_tolerance: float | None = None
    via: tuple[Pose, ...] = ()
    goal_area: GoalArea | None = None
    concurrency_slot: int = 0


@dataclass(frozen=True)
class ExePathGoal:
    """Follow a path. Tolerances [m, rad] of None are the server's ``dist_tolerance`` and ``angle_tolerance``.

    With a ``goal_area`` the robot has arrived as soon as it is inside, regardless of controller and tolerances.
    """

    path: Path
    controller: str = ""
    dist_tolerance: float | None = None
    angle_tolerance: float | None = None
    goal_area: GoalArea | None = None
    concurrency_slot: int = 0


@dataclass(frozen=True)
class RecoveryGoal:
    """Run a recovery behaviour.

    Attributes
    ----------
    parameters : mapping
        Values of parameters of the behaviour for this run only, e.g. ``{"angle": 1.57}`` for ``rotate``.
    """

    behavior: str = ""
    concurrency_slot: int = 0
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class RefinePathGoal:
    """Improve a path."""

    path: Path
    refiner: str = ""
    concurrency_slot: int = 0


@dataclass(frozen=True)
class MoveBaseGoal:
    """Go to a pose: plan, follow, recover.

    Attributes
    ----------
    recovery_behaviors : tuple of str, optional
        Names to try in order; None = all that are loaded, in load order, but for those of ``escalation_behaviors``
        and the one that is run where robots meet, see ``right_of_way_behavior``; empty = none.
    dist_tolerance, angle_tolerance : float, optional
        Arrival tolerances [m, rad], None = the server's. Where the target cannot be reached, the path may end that far
        from it too; the robot then comes the nearer to the path's end, at least to a quarter of the tolerance.
    goal_area : GoalArea, optional
        Go to the cheapest place inside instead of to ``target_pose``, and stop as soon as inside.
    via : tuple of Pose
        Poses to pass on the way to the target, in order and without a stop, each to within the arrival tolerance along
        the path. TypeError where one is no pose; not together with a ``goal_area``.
    """

    target_pose: Pose
    planner: str = ""
    controller: str = ""
    recovery_behaviors: tuple[str, ...] | None = None
    dist_tolerance: float | None = None
    angle_tolerance: float | None = None
    goal_area: GoalArea | None = None
    via: tuple[Pose, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "via", tuple(self.via))
        for index, pose in enumerate(self.via):
            if not isinstance(pose, Pose):
                raise TypeError(f"via[{index}] must be a Pose, got {type(pose).__name__}")


@dataclass(frozen=True)
class FollowWaypointsGoal:
    """Visit poses in order, each with a ``move_base`` goal.

    Attributes
    ----------
    loops : int
        How often the whole list is visited; ValueError if it is not at least 1.
    stop_on_failure : bool
        End the sequence at the first visit that fails; otherwise go on to the next pose.
    task : callable, optional
        Called as ``task(index, pose)`` at every pose that was reached, while the robot stands there. It may take its
        time; one that raises ends the sequence with INTERNAL_ERROR, and so does one that stops simulated time for
        longer than ``hang_guard`` (what blocks for real belongs into ``with clock.outside()``).
    planner, controller, recovery_behaviors, dist_tolerance, angle_tolerance
        As in ``MoveBaseGoal``.
    """

    waypoints: tuple[Pose, ...]
    loops: int = 1
    stop_on_failure: bool = True
    task: WaypointTask | None = None
    planner: str = ""
    controller: str = ""
    recovery_behaviors: tuple[str, ...] | None = None
    dist_tolerance: float | None = None
    angle_tolerance: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "waypoints", tuple(self.waypoints))
        if self.loops < 1:
            raise ValueError(f"loops must be at least 1, got {self.loops}")

    @property
    def visits(self) -> int:
        """Number of visits of the sequence."""
        return len(self.waypoints) * self.loops

    def visit(self, number: int) -> MoveBaseGoal:
        """Return the goal of one visit, counted from 0 over all loops."""
        return MoveBaseGoal(
            self.waypoints[number % len(self.waypoints)],
            self.planner,
            self.controller,
            self.recovery_behaviors,
            self.dist_tolerance,
            self.angle_tolerance,
        )


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
    ``permanent`` says of a failure that planning anew cannot change it.
    """

    path: Path | None = None
    cost: float = 0.0
    planner: str = ""
    plugin_outcome: int | None = None
    plugin_message: str = ""
    permanent: bool = False


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


@dataclass(frozen=True)
class ExePathFeedback:
    """One observed control cycle.

    Attributes
    ----------
    outcome, message
        Of the last controller call, also of a failed one that is being retried.
    dist_to_goal, angle_to_goal : float
        Straight distance [m] and rotation [rad] to the last pose of the path.
    distance_along_path : float
        Distance to go along the path [m].
    time_to_goal : float
        ``distance_along_path`` at the mean speed since the robot set off [s]; infinite until it has come 5 cm.
    last_command : Command, optional
        What the plugin computed, also where something else was sent.
    """

    outcome: int
    message: str
    current_pose: Pose
    dist_to_goal: float
    angle_to_goal: float
    distance_along_path: float
    time_to_goal: float
    last_command: Command | None = None


@dataclass(frozen=True)
class MoveBaseFeedback(ExePathFeedback):
    """The same of a robot on its way to a pose, whose path leads through all via poses that are left.

    Attributes
    ----------
    via_left : int
        How many via poses the robot has not passed yet.
    """

    via_left: int = 0


@dataclass(frozen=True)
class FollowWaypointsFeedback:
    """Progress of a waypoint sequence.

    Attributes
    ----------
    visit, waypoint : int
        The present visit, counted from 0 over all loops, and the index of its pose.
    results : tuple of MoveBaseResult
        The visits that have ended.
    driving : ExePathFeedback, optional
        Feedback of the present visit; None when it has just ended.
    """

    visit: int
    waypoint: int
    results: tuple[MoveBaseResult, ...]
    driving: ExePathFeedback | None


@dataclass(frozen=True)
class NoFeedback:
    """Feedback of the actions that have none; never published."""
