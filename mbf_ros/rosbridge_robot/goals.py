"""Our actions as the robot's rosbridge offers them to clients of ROS 2: ``advertise_action`` of its protocol.

The protocol cannot reject a goal. So the actions are offered once goals can be driven, and what is refused ends
aborted with outcome and text. A goal that a newer one has taken over ends aborted with the outcome CANCELED: ROS 2
knows a canceled goal only where its client has asked for that. Where the connection is lost nobody can cancel a goal
any more, or learn of its end: all goals that came over it are canceled.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import (
    ActionResult,
    ExePathResult,
    FollowWaypointsResult,
    GetPathResult,
    MoveBaseResult,
    RecoveryResultMessage,
    RefinePathResult,
)
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_ros.messages.action_mapping import RefusedGoal
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message, MessageError
from mbf_ros.rosbridge.actions import STATUSES, Status
from mbf_ros.rosbridge.navigation import ACTIONS
from mbf_ros.rosbridge.protocol import Operation, OperationError, absolute, frame, text_in
from mbf_ros.rosbridge_robot.connection import Connection, NotConnectedError

FAILURE_AND_JUMP: dict[Any, tuple[int, int]] = {
    GetPathResult: (GetPathOutcome.FAILURE, GetPathOutcome.TF_ERROR),
    ExePathResult: (ExePathOutcome.FAILURE, ExePathOutcome.TF_ERROR),
    RecoveryResultMessage: (RecoveryOutcome.FAILURE, RecoveryOutcome.TF_ERROR),
    MoveBaseResult: (MoveBaseOutcome.FAILURE, MoveBaseOutcome.TF_ERROR),
    FollowWaypointsResult: (MoveBaseOutcome.FAILURE, MoveBaseOutcome.TF_ERROR),
    RefinePathResult: (RefinePathOutcome.FAILURE, RefinePathOutcome.STOPPED),
}
"""Outcomes of a goal that asks for what we do not support, and of one during which the robot's time jumped."""
LARGE = 1e38
"""What stands for infinity; servers find that the largest float32 overflows when it comes as text."""


@dataclass(eq=False)
class _Goal:
    """A goal that has not got its result, of the action ``name``; ``jump`` says how the robot's time jumped."""

    name: str
    handle: AnyGoalHandle
    is_cancel_asked: bool = False
    jump: str = ""


def in_finite_numbers(value: Any) -> Any:
    """Return values of a message with 1e38 for numbers that are not finite.

    JSON has none of them, and a server on a robot may refuse null; the goal would never get its result then.
    """
    if isinstance(value, dict):
        return {name: in_finite_numbers(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [in_finite_numbers(inner) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return -LARGE if value < 0.0 else LARGE
    return value


class OfferedGoals:
    """Goals that come over a connection.

    Parameters
    ----------
    connection : callable
        Where feedback and results are sent.
    send : callable
        Sends a goal of ours.
    context : callable
        How stamps and frames relate to ours, now.
    """

    def __init__(
        self,
        connection: Callable[[], Connection],
        send: Callable[[Any], AnyGoalHandle],
        context: Callable[[], MessageContext],
    ) -> None:
        self._connection, self._send, self._context = connection, send, context
        self._lock = threading.Lock()
        self._goals: dict[str, _Goal] = {}

    @property
    def unfinished(self) -> int:
        """How many goals have not got their result."""
        return len(self._goals)

    @staticmethod
    def offers() -> Iterator[str]:
        """Yield the frames that offer all actions."""
        for name, mapping in ACTIONS.items():
            yield frame("advertise_action", action=name, type=mapping.type)

    def take_goal(self, operation: Operation) -> None:
        """Take a goal; raises OperationError where the operation names no action of ours."""
        name, goal_id = absolute(text_in(operation, "action")), text_in(operation, "id")
        mapping = ACTIONS.get(name)
        if mapping is None:
            raise OperationError(f"send_action_goal: {name} is not offered here")
        try:
            goal = mapping.goal(operation.get("args", {}), self._context())
        except RefusedGoal as error:
            self._answer_with(goal_id, name, mapping.refusal(error, self._context()), Status.ABORTED)
            return
        except MessageError as error:
            failure, _ = FAILURE_AND_JUMP[mapping.refused]
            self._answer(goal_id, name, mapping.refused(failure, str(error)), Status.ABORTED)
            return
        handle = self._send(goal)
        with self._lock:
            self._goals[goal_id] = taken = _Goal(name, handle)
        if operation.get("feedback") is not False and mapping.feedback is not None:
            encode = mapping.feedback
            handle.add_feedback_callback(
                lambda feedback: self._send_feedback(goal_id, taken, encode(feedback, self._context()))
            )
        handle.add_done_callback(lambda _: self._end(goal_id, taken))

    def take_cancel(self, operation: Operation) -> None:
        """Cancel a goal; one that has ended meanwhile is left alone."""
        found = self._goals.get(text_in(operation, "id"))
        if found is not None:
            found.is_cancel_asked = True
            found.handle.cancel("canceled by the client")

    def abandon(self, reason: str) -> None:
        """Cancel all goals without an answer: there is nobody left to hear it."""
        with self._lock:
            goals, self._goals = self._goals, {}
        for goal in goals.values():
            goal.handle.cancel(reason)

    def abort_all(self, reason: str) -> None:
        """End all goals with TF_ERROR, because the robot's time has jumped."""
        with self._lock:
            goals = list(self._goals.values())
        for goal in goals:
            goal.jump = reason
            goal.handle.cancel(reason)

    # -------------------------------------------------------------------------------------------------------
    def _end(self, goal_id: str, goal: _Goal) -> None:
        with self._lock:
            if self._goals.get(goal_id) is not goal:
                return  # it was abandoned
            del self._goals[goal_id]
        status, result = goal.handle.status, goal.handle.result
        assert result is not None
        if goal.jump and status is GoalStatus.CANCELED:
            refused = ACTIONS[goal.name].refused
            self._answer(goal_id, goal.name, refused(FAILURE_AND_JUMP[refused][1], goal.jump), Status.ABORTED)
        elif status is GoalStatus.CANCELED and not goal.is_cancel_asked:
            self._answer(goal_id, goal.name, result, Status.ABORTED)
        else:
            self._answer(goal_id, goal.name, result, STATUSES[status])

    def _answer(self, goal_id: str, name: str, result: ActionResult, status: Status) -> None:
        self._answer_with(goal_id, name, ACTIONS[name].result(result, self._context()), status)

    def _answer_with(self, goal_id: str, name: str, message: Message, status: Status) -> None:
        values = in_finite_numbers(message)
        text = frame("action_result", id=goal_id, action=name, values=values, status=int(status), result=True)
        self._post(lambda connection: connection.answer(text))

    def _send_feedback(self, goal_id: str, goal: _Goal, values: object) -> None:
        text = frame("action_feedback", id=goal_id, action=goal.name, values=in_finite_numbers(values))
        if self._goals.get(goal_id) is goal:
            self._post(lambda connection: connection.newest(("feedback", goal_id), text))

    def _post(self, call: Callable[[Connection], None]) -> None:
        try:
            call(self._connection())
        except NotConnectedError:
            return  # the goals were abandoned with the connection
