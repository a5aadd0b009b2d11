"""Goals of the actions, with the fields of ``mbf_msgs``; see ``result_types`` and ``feedback_types``.

An empty plugin name means the first one loaded (for a running ``exe_path``: the running one). All values are frozen;
a goal object can be sent any number of times. A field of the wrong type is a TypeError that names it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_area import GoalArea
from mbf_abstract.goals.goal_fields import check_fields

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
        at most 1000 m and 2 pi, or inf = anywhere; None = the server's tolerances (with a ``goal_area`` 0: the area is
        tolerance enough).
    via : tuple of Pose
        Poses to pass between start and target, in order.
    goal_area : GoalArea, optional
        Any place inside counts as reached; ``target_pose`` is then ignored.
    concurrency_slot : int
        0..255; goals in different slots run in parallel, a new goal in a used slot preempts.
    max_retries : int, optional
        How often a planner that fails is called again; None = the server's ``planner_max_retries``, below 0 = until its
        patience is over.
    """

    target_pose: Pose
    start_pose: Pose | None = None
    planner: str = ""
    dist_tolerance: float | None = None
    angle_tolerance: float | None = None
    via: tuple[Pose, ...] = ()
    goal_area: GoalArea | None = None
    concurrency_slot: int = 0
    max_retries: int | None = None

    def __post_init__(self) -> None:
        check_fields(self)


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

    def __post_init__(self) -> None:
        check_fields(self)


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

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class RefinePathGoal:
    """Improve a path."""

    path: Path
    refiner: str = ""
    concurrency_slot: int = 0

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class MoveBaseGoal:
    """Go to a pose: plan, follow, recover.

    Attributes
    ----------
    recovery_behaviors : tuple of str, optional
        Names to try in order; None = all that are loaded, in load order, but for those of ``escalation_behaviors``
        and the one that is run where robots meet, see ``right_of_way_behavior``; empty = none.
    dist_tolerance, angle_tolerance : float, optional
        Arrival tolerances [m, rad] of at most 1000 m and 2 pi, None = the server's. Where the target cannot be reached,
        the path may end that far from it too; the robot then comes the nearer to the path's end, at least to a quarter
        of the tolerance.
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
        check_fields(self)


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
        check_fields(self)
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
