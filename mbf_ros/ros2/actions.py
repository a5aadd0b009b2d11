"""An action of ours as an action server of ROS 2.

Goals wait as coroutines of the executor, not on threads. What navigation refuses, or what means nothing, is accepted
and ends aborted with outcome and text, as a rejected goal of ROS 2 has no result; see decision 0023. Rejected are goals
beyond ``MAX_GOALS`` and those that come before the node is ready or while it ends. A goal that a newer one has taken
over ends aborted with the outcome CANCELED: ROS 2 knows a canceled goal only where its client has asked for that. So
does one whose client is gone; see ``clients``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

from mbf_abstract.event_values import error_text
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import ActionResult
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_ros.messages import mbf_actions
from mbf_ros.messages.action_mapping import ActionMapping, RefusedGoal
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message
from mbf_ros.ros2.clients import GoalClients, action_clients
from mbf_ros.ros2.conversion import fill, interface_class, to_dict
from mbf_ros.ros2.running import settle

Outcomes: TypeAlias = (
    type[GetPathOutcome]
    | type[ExePathOutcome]
    | type[RecoveryOutcome]
    | type[RefinePathOutcome]
    | type[MoveBaseOutcome]
)
More: TypeAlias = Callable[[Any], Message]
"""Further fields of a feedback or a result of ours, which it takes; None where the action of ours has no feedback."""
ACTIONS: dict[str, tuple[ActionMapping[Any, Any], Outcomes]] = {
    "get_path": (mbf_actions.GET_PATH, GetPathOutcome),
    "exe_path": (mbf_actions.EXE_PATH, ExePathOutcome),
    "recovery": (mbf_actions.RECOVERY, RecoveryOutcome),
    "move_base": (mbf_actions.MOVE_BASE, MoveBaseOutcome),
}
"""Mapping and outcomes by the private names of the actions."""
MAX_GOALS = 50
"""How many goals of one action may be unfinished at a time."""
QUEUE = 2 * MAX_GOALS
"""How many requests of each kind, and answers, of one action may wait to be taken; of ROS 2's usual 10, goals that come
at once are lost and neither accepted nor rejected."""


@dataclass(frozen=True)
class Serving:
    """What all action servers of a node have of it.

    Attributes
    ----------
    send : callable
        Sends a goal of ours.
    context : callable
        How stamps and frames relate to ours, now.
    refusal : callable
        Why no goals are taken; empty if they are.
    on_fault : callable
        Takes an exception that no goal may raise.
    """

    send: Callable[[Any], AnyGoalHandle]
    context: Callable[[], MessageContext]
    refusal: Callable[[], str]
    on_fault: Callable[[Exception], None]


class ServedAction:
    """One action server.

    Parameters
    ----------
    name : str
        As clients know it; ``~/`` stands for the name of the node.
    outcomes : type of enum
        Those of its results.

    Attributes
    ----------
    unfinished : int
        How many goals have not got their result.
    """

    def __init__(
        self, node: Any, name: str, mapping: ActionMapping[Any, Any], outcomes: Outcomes, serving: Serving
    ) -> None:
        from rclpy.action import ActionServer
        from rclpy.qos import QoSProfile

        self._node, self._mapping, self._outcomes = node, mapping, outcomes
        self._serving, self._context = serving, serving.context
        self._class = interface_class(self._mapping.type)
        self._goals: dict[bytes, AnyGoalHandle] = {}
        self._jumps: dict[bytes, str] = {}
        self._clients = GoalClients(partial(action_clients, node, name))
        self.unfinished = 0
        ActionServer(
            node,
            self._class,
            name,
            execute_callback=self._execute,
            goal_callback=self._accept,
            handle_accepted_callback=self._begin,
            cancel_callback=self._cancel,
            goal_service_qos_profile=QoSProfile(depth=QUEUE),
            result_service_qos_profile=QoSProfile(depth=QUEUE),
            cancel_service_qos_profile=QoSProfile(depth=QUEUE),
        )

    def abort_all(self, message: str) -> None:
        """End all goals with the outcome TF_ERROR."""
        for key, handle in self._goals.items():
            self._jumps[key] = message
            handle.cancel(message)

    def cancel_abandoned(self) -> None:
        """Cancel the goals whose clients are gone; on the executor's thread."""
        for handle in map(self._goals.get, self._clients.abandoned(self._goals)):
            if handle is not None and not handle.cancel_requested:
                self._node.get_logger().warning(f"{self._mapping.type}: goal canceled: its client is gone")
                handle.cancel("its client is gone")

    # ------------------------------------------------------------------- all of these on the executor's thread
    def _accept(self, request: Any) -> Any:
        from rclpy.action import GoalResponse

        many = f"{MAX_GOALS} goals are unfinished already" if self.unfinished >= MAX_GOALS else ""
        if reason := self._serving.refusal() or many:
            self._node.get_logger().warning(f"{self._mapping.type}: goal rejected: {reason}")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _begin(self, goal_handle: Any) -> None:
        """Count a goal and run it; not called where its client is gone before it hears that the goal is accepted."""
        self.unfinished += 1
        goal_handle.execute()

    def _cancel(self, goal_handle: Any) -> Any:
        from rclpy.action import CancelResponse

        handle = self._goals.get(bytes(goal_handle.goal_id.uuid))
        if handle is not None:
            handle.cancel("canceled by the client")
        return CancelResponse.ACCEPT

    async def _execute(self, goal_handle: Any) -> Any:
        """Run one goal; returns the message of its result."""
        message, status = await self._ended(goal_handle)
        if status is GoalStatus.SUCCEEDED:
            goal_handle.succeed()
        elif status is GoalStatus.CANCELED and goal_handle.is_cancel_requested:
            goal_handle.canceled()
        else:
            goal_handle.abort()
        executor = self._node.executor  # sends the result in a task that comes after the next one
        executor.create_task(executor.create_task, self._count_down)
        return message

    def _count_down(self) -> None:
        self.unfinished -= 1

    async def _ended(self, goal_handle: Any) -> tuple[Any, GoalStatus]:
        """Run one goal; returns message and status. Of an exception rclpy would make the outcome 0, a success."""
        try:
            return await self._run(goal_handle)
        except RefusedGoal as error:
            return fill(self._class.Result(), self._mapping.refusal(error, self._context())), GoalStatus.REJECTED
        except Exception as error:  # a fault of ours
            self._serving.on_fault(error)
            text = f"{type(error).__name__}: {error_text(error)}"
            return self._message(self._mapping.refused(self._outcomes.INTERNAL_ERROR, text)), GoalStatus.ABORTED

    def _message(self, result: ActionResult, more: Message | None = None) -> Any:
        return fill(self._class.Result(), {**self._mapping.result(result, self._context()), **(more or {})})

    async def _run(self, goal_handle: Any) -> tuple[Any, GoalStatus]:
        from rclpy.task import Future

        key = bytes(goal_handle.goal_id.uuid)
        handle = self._serving.send(self._mapping.goal_of(to_dict(goal_handle.request), self._context()))
        if goal_handle.is_cancel_requested:  # before this coroutine had its first turn
            handle.cancel("canceled by the client")
        self._goals[key], more = handle, self._observe(goal_handle, handle)
        self._clients.welcome(key)
        try:
            ended = Future(executor=self._node.executor)
            if self._mapping.feedback is not None:
                handle.add_feedback_callback(lambda feedback: self._publish_feedback(goal_handle, feedback, more))
            handle.add_done_callback(partial(settle, ended, self._node.executor))
            await ended
        except Exception:
            handle.cancel("the node failed")
            raise
        finally:
            del self._goals[key]
        self._show_last(goal_handle, handle, more)
        fields = more(handle.result)
        assert handle.result is not None
        jump = self._jumps.pop(key, "")
        if jump and handle.status is GoalStatus.CANCELED:
            tf_error = self._outcomes.__members__.get("TF_ERROR", self._outcomes.FAILURE)
            return self._message(self._mapping.refused(tf_error, jump), fields), GoalStatus.ABORTED
        return self._message(handle.result, fields), handle.status

    def _observe(self, goal_handle: Any, handle: AnyGoalHandle) -> More:
        """Return what gives the fields of feedback and result that are not in ours, of a goal that begins."""
        return lambda shown: {}

    def _show_last(self, goal_handle: Any, handle: AnyGoalHandle, more: More) -> None:
        """Publish a last feedback, before the result; nothing here."""

    def _publish_feedback(self, goal_handle: Any, feedback: Any, more: More) -> None:
        """Publish a feedback, on the thread of callbacks."""
        assert self._mapping.feedback is not None
        values = {**self._mapping.feedback(feedback, self._context()), **more(feedback)}
        goal_handle.publish_feedback(fill(self._class.Feedback(), values))
