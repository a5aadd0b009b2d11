"""The action ``move_base`` of ROS 1 over topics (actionlib), for pages and scripts of that time.

A goal comes on ``/move_base/goal``, its end is on ``/move_base/result``; ``/move_base/status`` is sent on every change
and once a second, because clients give up without it. A new goal takes over the running one, which ends preempted.
Goals belong to no client: as in ROS 1 they go on when their client is gone.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mbf_abstract.goals.feedback_types import ExePathFeedback
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import GetPathOutcome
from mbf_ros.messages.action_mapping import RefusedGoal, pose_or_refuse
from mbf_ros.messages.geometry import MessageContext, pose_stamped
from mbf_ros.messages.interfaces import Message
from mbf_ros.rosbridge.protocol import frame
from mbf_ros.rosbridge.topics import TopicTable

ROOT = "/move_base"
ACTIVE, PREEMPTED, SUCCEEDED, ABORTED, REJECTED, PREEMPTING = 1, 2, 3, 4, 5, 6
STATUSES = {
    GoalStatus.PENDING: ACTIVE,
    GoalStatus.ACTIVE: ACTIVE,
    GoalStatus.PAUSED: ACTIVE,
    GoalStatus.CANCELING: PREEMPTING,
    GoalStatus.SUCCEEDED: SUCCEEDED,
    GoalStatus.CANCELED: PREEMPTED,
    GoalStatus.ABORTED: ABORTED,
    GoalStatus.REJECTED: REJECTED,
}
ENDED_SHOWN = 10
"""How many goals that are over are in the list of statuses."""


@dataclass
class _Goal:
    goal_id: Message
    status: int = ACTIVE
    text: str = ""
    handle: AnyGoalHandle | None = field(default=None, repr=False)


class ActionlibServer:
    """The topics of the action; used on the event loop, ``post`` brings callbacks of goals there.

    Parameters
    ----------
    now : callable
        Our time [s].
    post : callable
        Has a function called on the event loop.
    """

    def __init__(
        self,
        topics: TopicTable,
        navigator: Navigator,
        context: MessageContext,
        now: Callable[[], float],
        post: Callable[..., None],
    ) -> None:
        self._topics, self._navigator, self._context, self._now, self._post = topics, navigator, context, now, post
        self._goals: list[_Goal] = []
        self._numbers = itertools.count(1)
        topics.add_input(f"{ROOT}/goal", "move_base_msgs/MoveBaseActionGoal", self._take_goal)
        topics.add_input(f"{ROOT}/cancel", "actionlib_msgs/GoalID", self._cancel)
        topics.add_output(f"{ROOT}/status", "actionlib_msgs/GoalStatusArray")
        topics.add_output(f"{ROOT}/feedback", "move_base_msgs/MoveBaseActionFeedback")
        topics.add_output(f"{ROOT}/result", "move_base_msgs/MoveBaseActionResult")

    def send_status(self) -> None:
        """Send the statuses of all goals, and of the last ones that are over."""
        for goal in self._goals:
            if goal.handle is not None and not goal.handle.done:
                goal.status = STATUSES[goal.handle.status]
        listed = [_status(goal) for goal in self._goals]
        self._send("status", {"header": self._header(), "status_list": listed})

    # ------------------------------------------------------------------------------------------------- goals
    def _take_goal(self, message: Message) -> None:
        given = message["goal_id"]
        goal_id = {**given, "id": given["id"] or f"mbf-{next(self._numbers)}"}
        goal = _Goal(goal_id)
        self._goals.append(goal)
        try:
            pose = pose_or_refuse(message["goal"], self._context, "target_pose", GetPathOutcome.INVALID_GOAL)
        except RefusedGoal as error:
            self._finish(goal, REJECTED, str(error))
            return
        goal.handle = self._navigator.send(MoveBaseGoal(pose))
        goal.handle.add_feedback_callback(lambda feedback: self._post(self._send_feedback, goal, feedback))
        goal.handle.add_done_callback(lambda handle: self._post(self._end, goal, handle))
        self.send_status()

    def _cancel(self, message: Message) -> None:
        """Cancel by id, or all up to a time, or all; as actionlib has it."""
        wanted, stamp = message["id"], message["stamp"]
        until = (stamp["sec"], stamp["nanosec"])
        for goal in self._goals:
            sent = goal.goal_id["stamp"]
            by_time = until != (0, 0) and (sent["sec"], sent["nanosec"]) <= until
            if goal.handle is not None and (
                goal.goal_id["id"] == wanted or by_time or (not wanted and until == (0, 0))
            ):
                goal.handle.cancel("canceled by a client")

    def _end(self, goal: _Goal, handle: AnyGoalHandle) -> None:
        assert handle.result is not None
        self._finish(goal, STATUSES[handle.status], f"{handle.result.outcome_name}: {handle.result.message}")

    def _finish(self, goal: _Goal, status: int, text: str) -> None:
        goal.status, goal.text, goal.handle = status, text, None
        over = [one for one in self._goals if one.handle is None]
        for old in over[:-ENDED_SHOWN]:
            self._goals.remove(old)
        self._send("result", {"header": self._header(), "status": _status(goal), "result": {}})
        self.send_status()

    def _send_feedback(self, goal: _Goal, feedback: ExePathFeedback) -> None:
        if goal.handle is not None:
            position = {"base_position": pose_stamped(feedback.current_pose, self._context)}
            self._send("feedback", {"header": self._header(), "status": _status(goal), "feedback": position})

    def _header(self) -> Message:
        return self._context.header("", self._now())

    def _send(self, name: str, message: Message) -> None:
        topic = f"{ROOT}/{name}"
        self._topics.send(topic, frame("publish", topic=topic, msg=as_ros_1(message)))


def _status(goal: _Goal) -> Message:
    return {"goal_id": goal.goal_id, "status": goal.status, "text": goal.text}


def as_ros_1(value: Any) -> Any:
    """Return a message with the fields of ROS 1 in its times, and a counter in its headers."""
    if isinstance(value, list):
        return [as_ros_1(one) for one in value]
    if not isinstance(value, dict):
        return value
    if value.keys() == {"sec", "nanosec"}:
        return {"secs": value["sec"], "nsecs": value["nanosec"]}
    fields = {name: as_ros_1(one) for name, one in value.items()}
    return {"seq": 0, **fields} if fields.keys() == {"stamp", "frame_id"} else fields
