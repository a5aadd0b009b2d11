"""The goals that a run visits, one after the other: those of the scenario, then those from outside.

The sequence runs on the thread that calls ``visit_goals``. ``go_to``, ``cancel`` and ``end`` are called on the
simulator's thread (``DriveLoop.on_tick``), between two steps, so that a goal from outside comes at a definite time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.feedback_types import FollowWaypointsFeedback
from mbf_abstract.goals.goal_types import FollowWaypointsGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import MoveBaseResult
from mbf_abstract.outcomes import MoveBaseOutcome
from terrain.session.arrival import Arrival
from terrain.session.executives import GoalExecutive
from terrain.session.session import Session

NO_GOALS = MoveBaseResult(MoveBaseOutcome.FAILURE, "the scenario has no goals")
REPLACED = "a new goal was asked for"


@dataclass(frozen=True)
class AskedGoal:
    """Where to go, and with which plugins; without a name the first ones loaded."""

    pose: Pose
    planner: str = ""
    controller: str = ""


@dataclass(frozen=True)
class AskedWaypoints:
    """Waypoints to visit in their order, so many times, with the action ``follow_waypoints`` and these plugins."""

    poses: tuple[Pose, ...]
    loops: int = 1
    planner: str = ""
    controller: str = ""


class GoalSequence:
    """Visits goals with an executive; the first failure ends the scenario's part.

    Parameters
    ----------
    session : Session
        Running.
    stay : bool
        Wait for further goals after those of the scenario, until ``end`` is called.

    Attributes
    ----------
    on_goal : list of callables
        Called with each goal from outside, before it is sent.
    is_waiting : bool
        Whether there is no goal to go to at the moment.
    target : Pose or None
        The present goal, of waypoints the one that the robot goes to.
    last_result : MoveBaseResult or None
        How the last goal has ended, or the last of the waypoints that were visited together.
    arrivals : list of Arrival
        Where the robot was in truth when navigation reported a goal as reached, goal by goal.
    """

    def __init__(self, session: Session, executive: GoalExecutive, stay: bool = False) -> None:
        self.on_goal: list[Callable[[Pose], None]] = []
        self.is_waiting = False
        self.target: Pose | None = None
        self.last_result: MoveBaseResult | None = None
        self._session = session
        self._executive = executive
        self._stay = stay
        self.arrivals: list[Arrival] = []
        self._condition = session.clock.condition()
        self._next: AskedGoal | AskedWaypoints | None = None
        self._following: AnyGoalHandle | None = None
        self._end: MoveBaseResult | None = None
        self._limit = self._deadline = float("inf")
        session.loop.on_tick.append(self._watch)
        session.loop.on_failure.append(lambda: self.end("the simulation has failed"))

    def visit_goals(self) -> MoveBaseResult:
        """Visit the goals of the scenario, and others if they come; returns the result of the last one."""
        limit = self._session.scenario.time_limit
        self._allow(limit, since=0.0)
        result = NO_GOALS
        for goal in self._session.goals:
            if self._next is not None or self._end is not None:
                break
            result = self._visit(AskedGoal(goal))
            if not result.success:
                break
        if self._end is not None and self.last_result is None:
            self.last_result = result = self._end
        while (asked := self._await_goal()) is not None:
            if isinstance(asked, AskedWaypoints):
                self._allow(limit * asked.loops * len(asked.poses), self._session.simulation.time)
                result = self._follow(asked)
                continue
            self._announce(asked.pose)
            self._allow(limit, self._session.simulation.time)
            result = self._visit(asked)
        return result

    # ------------------------------------------------------------------------------ from other threads
    def go_to(self, goal: AskedGoal | AskedWaypoints) -> None:
        """Go there instead of to the present goal and what is left of the scenario."""
        with self._condition:
            self._next = goal
            self._condition.notify_all()
        self.cancel(REPLACED)

    def cancel(self, reason: str) -> None:
        """Cancel the present goal or waypoints; the rest of the scenario goes with it."""
        self._executive.cancel(reason)
        if self._following is not None:
            self._following.cancel(reason)

    def end(self, reason: str) -> None:
        """Cancel the present goal and take no more."""
        with self._condition:
            self._end = self._end or MoveBaseResult(MoveBaseOutcome.CANCELED, reason)
            self._condition.notify_all()
        self.cancel(reason)

    # -------------------------------------------------------------------------------------------------
    def _allow(self, seconds: float, since: float) -> None:
        """Cancel what drives then, that long [s] after a time [s]."""
        self._limit, self._deadline = seconds, since + seconds

    def _visit(self, goal: AskedGoal) -> MoveBaseResult:
        self.target = goal.pose
        self.last_result = result = self._executive.drive(goal.pose, goal.planner, goal.controller)
        self.target = None
        if result.success and self._executive.arrives:
            self.arrivals.append(Arrival.at(goal.pose, self._session.loop.true_pose, result))
        return result

    def _announce(self, goal: Pose) -> None:
        """Note a goal from outside."""
        self._session.recorder.goals.append(goal)
        for listener in self.on_goal:
            listener(goal)

    def _follow(self, asked: AskedWaypoints) -> MoveBaseResult:
        """Visit waypoints with the action for them, whatever the executive; each visit counts as a goal of its own."""
        goal = FollowWaypointsGoal(asked.poses, asked.loops, planner=asked.planner, controller=asked.controller)
        self._begin_visit(goal, 0)
        self._following = handle = self._session.navigator.send(goal)
        ended: list[MoveBaseResult] = []
        handle.subscribe(lambda handle: self._take_visits(goal, ended, handle.feedback))
        result = handle.wait()
        self._following = self.target = None
        last = result.results[-1] if result.results else MoveBaseResult(result.outcome, result.message)
        self.last_result = all_of_it = replace(last, outcome=result.outcome, message=result.message)
        return all_of_it

    def _begin_visit(self, goal: FollowWaypointsGoal, visit: int) -> None:
        self.target = goal.waypoints[visit % len(goal.waypoints)]
        self._announce(self.target)

    def _take_visits(
        self, goal: FollowWaypointsGoal, ended: list[MoveBaseResult], feedback: FollowWaypointsFeedback | None
    ) -> None:
        """Note the visits that have ended since the last feedback; on the thread of the action, at that very time."""
        results = feedback.results if feedback is not None else ()
        for result in results[len(ended) :]:
            ended.append(result)
            if result.success and self.target is not None:
                self.arrivals.append(Arrival.at(self.target, self._session.loop.true_pose, result))
                if len(ended) < goal.visits:
                    self._begin_visit(goal, len(ended))

    def _await_goal(self) -> AskedGoal | AskedWaypoints | None:
        """Wait for the next goal if there may be one; None when the sequence is over."""
        self._deadline = float("inf")
        with self._condition:
            self.is_waiting = True
            while self._stay and self._next is None and self._end is None:
                self._condition.wait()
            self.is_waiting = False
            asked, self._next = self._next, None
            return asked if self._end is None else None

    def _watch(self, time: float) -> None:
        """Between two steps of the world: end a goal that is late, or began while another or the end was asked for."""
        if self.target is not None and self._end is not None:
            self.cancel(self._end.message)
        elif self.target is not None and self._next is not None:
            self.cancel(REPLACED)
        if time >= self._deadline:
            self._deadline = float("inf")
            self.cancel(f"the time limit of {self._limit:g} s")
