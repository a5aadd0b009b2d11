"""Actions of ROS 2 for clients: goals run beside each other, so a goal can be canceled while it runs.

Every end of a goal that navigation knows is a result with an outcome or an error code and a text, also that of a goal
whose numbers mean nothing. Only what is no goal of its action at all fails (``result`` false).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from mbf_abstract.config.findings import describe_value
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import ActionResult
from mbf_ros.messages.action_mapping import ActionMapping, RefusedGoal
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message, MessageError
from mbf_ros.rosbridge.client import Client
from mbf_ros.rosbridge.protocol import OperationError, frame, no_such

MAX_GOALS = 20
"""How many goals of one client may be unfinished at a time."""


class Status(IntEnum):
    """Statuses of action_msgs/GoalStatus in which a goal ends."""

    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


STATUSES = {
    GoalStatus.SUCCEEDED: Status.SUCCEEDED,
    GoalStatus.CANCELED: Status.CANCELED,
    GoalStatus.ABORTED: Status.ABORTED,
    GoalStatus.REJECTED: Status.ABORTED,  # a rejected goal of ROS 2 has no result that could carry the reason
}

Send = Callable[[Any], AnyGoalHandle]


@dataclass(frozen=True)
class ServedAction:
    """One action: how its messages are ours, and what sends a goal."""

    mapping: ActionMapping[Any, Any]
    send: Send


class ActionTable:
    """Actions by name; used on the event loop only."""

    def __init__(self, context: MessageContext) -> None:
        self.actions: dict[str, ServedAction] = {}
        self._context = context
        self._running: dict[str, list[AnyGoalHandle]] = {}

    def send_goal(
        self, client: Client, name: str, type_name: str, goal_id: str | None, values: object, wants_feedback: bool
    ) -> None:
        """Send a client's goal; feedback and result go to the client as they come."""
        try:
            action, goal = self._checked(client, name, type_name, goal_id, values)
        except RefusedGoal as error:
            values = self.actions[name].mapping.refusal(error, self._context)
            self._answer(client, name, goal_id, {"values": values, "status": int(Status.ABORTED), "result": True})
            return
        except (OperationError, MessageError) as error:
            self._answer(client, name, goal_id, {"values": str(error), "status": 0, "result": False})
            return
        assert goal_id is not None
        handle = action.send(goal)
        client.goals[goal_id] = handle
        self._running.setdefault(name, []).append(handle)
        loop = asyncio.get_running_loop()
        if wants_feedback and action.mapping.feedback is not None:
            self._forward_feedback(client, name, goal_id, action.mapping.feedback, handle, loop)
        handle.add_done_callback(_on_loop(loop, lambda ended: self._end(client, name, goal_id, ended)))

    def cancel_goal(self, client: Client, goal_id: str | None) -> None:
        """Cancel a goal of the client; raises OperationError if it has none of this id."""
        handle = client.goals.get(goal_id or "")
        if handle is None:
            raise OperationError(f"cancel_action_goal: there is no unfinished goal {goal_id!r}")
        handle.cancel("canceled by the client")

    def cancel_all(self, name: str) -> None:
        """Cancel all goals of an action, whoever has sent them over the bridge."""
        for handle in self._running.get(name, ()):
            handle.cancel("canceled by a client")

    # -------------------------------------------------------------------------------------------------------
    def _checked(
        self, client: Client, name: str, type_name: str, goal_id: str | None, values: object
    ) -> tuple[ServedAction, Any]:
        action = self.actions.get(name)
        if action is None:
            raise OperationError(no_such("action", name, self.actions))
        package, _, short = action.mapping.type.partition("/action/")
        if type_name not in ("", action.mapping.type, f"{package}/{short}"):
            raise OperationError(f"the action {name!r}: expected the type {action.mapping.type}, got {type_name}")
        free_id(client, goal_id)
        return action, action.mapping.goal(values, self._context)

    def _forward_feedback(
        self,
        client: Client,
        name: str,
        goal_id: str,
        encode: Callable[[Any, MessageContext], Message],
        handle: AnyGoalHandle,
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        kind: Hashable = ("feedback", goal_id)

        def send(feedback: Any) -> None:
            values = encode(feedback, self._context)
            if goal_id in client.goals:  # the client may be gone
                client.outbox.newest(kind, frame("action_feedback", id=goal_id, action=name, values=values))

        handle.add_feedback_callback(_on_loop(loop, send))

    def _end(self, client: Client, name: str, goal_id: str, handle: AnyGoalHandle) -> None:
        self._running[name].remove(handle)
        if client.goals.get(goal_id) is handle:
            del client.goals[goal_id]
            assert handle.result is not None
            self._answer(client, name, goal_id, self._result_fields(name, handle.result, STATUSES[handle.status]))

    def _result_fields(self, name: str, result: ActionResult, status: Status) -> Message:
        return {
            "values": self.actions[name].mapping.result(result, self._context),
            "status": int(status),
            "result": True,
        }

    @staticmethod
    def _answer(client: Client, name: str, goal_id: str | None, fields: Message) -> None:
        client.outbox.answer(frame("action_result", id=goal_id, action=name, **fields))


def free_id(client: Client, goal_id: str | None) -> str:
    """Return the id of a new goal; raises OperationError where it is missing or used, or the client has too many."""
    if goal_id is None or goal_id in client.goals:
        raise OperationError(
            f"send_action_goal: id: expected one that no unfinished goal has, got {describe_value(goal_id)}"
        )
    if len(client.goals) >= MAX_GOALS:
        raise OperationError(f"{MAX_GOALS} goals of this client are unfinished already")
    return goal_id


def _on_loop(loop: asyncio.AbstractEventLoop, call: Callable[[Any], None]) -> Callable[[Any], None]:
    """Let a callback of a goal run on the event loop, unless the server is closed by then."""

    def post(value: Any) -> None:
        with suppress(RuntimeError):  # the server is closed
            loop.call_soon_threadsafe(call, value)

    return post
