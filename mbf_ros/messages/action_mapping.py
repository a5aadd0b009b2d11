"""What the mapping of an action consists of, and how a goal is refused whose numbers mean nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.result_types import ActionResult
from mbf_ros.messages.geometry import InvalidValueError, MessageContext, path_of, pose_of
from mbf_ros.messages.interfaces import Message, MessageError, completed

G = TypeVar("G")
R = TypeVar("R", bound=ActionResult)


class RefusedGoal(MessageError):
    """A goal of the right type that cannot be meant: ``outcome`` is INVALID_GOAL, INVALID_PATH or the like.

    ``fields`` are fields of its result that say more than the outcome, such as an error code of Nav2.
    """

    def __init__(self, outcome: int, message: str, **fields: int) -> None:
        super().__init__(message)
        self.outcome, self.fields = int(outcome), fields


@dataclass(frozen=True)
class ActionMapping(Generic[G, R]):
    """Between an action type of ROS 2 and our goals, results and feedback.

    Attributes
    ----------
    type : str
        ``package/action/Name``.
    goal_of : callable
        Makes our goal of a completed message; raises RefusedGoal.
    result : callable
        Makes the message of our result.
    feedback : callable, optional
        Makes the message of our feedback; None where the action has none.
    refused : callable
        Makes our result of an outcome and a text.
    """

    type: str
    goal_of: Callable[[Message, MessageContext], G]
    result: Callable[[R, MessageContext], Message]
    feedback: Callable[[Any, MessageContext], Message] | None
    refused: Callable[[int, str], R]

    def goal(self, values: object, context: MessageContext) -> G:
        """Return our goal of the values of a client.

        Raises
        ------
        MessageError
            A field is unknown, missing or not of its type; a RefusedGoal if a number means nothing.
        """
        return self.goal_of(completed(f"{self.type}_Goal", values, self.type), context)

    def refusal(self, error: RefusedGoal, context: MessageContext) -> Message:
        """Return the result of a goal that was refused."""
        return {**self.result(self.refused(error.outcome, str(error)), context), **error.fields}


def pose_or_refuse(message: Message, context: MessageContext, name: str, outcome: int, **fields: int) -> Pose:
    """Return the pose in a field of a goal; raises RefusedGoal with this outcome and fields where it is none.

    Its stamp is dropped: a goal is a place in its frame, as that frame is now.
    """
    try:
        return replace(pose_of(message[name], context, name), stamp=0.0)
    except InvalidValueError as error:
        raise RefusedGoal(outcome, str(error), **fields) from error


def path_or_refuse(message: Message, context: MessageContext, outcome: int, **fields: int) -> Path:
    """Return the path in the field ``path`` of a goal; raises RefusedGoal with outcome and fields where it is none."""
    try:
        return path_of(message["path"], context)
    except InvalidValueError as error:
        raise RefusedGoal(outcome, str(error), **fields) from error
