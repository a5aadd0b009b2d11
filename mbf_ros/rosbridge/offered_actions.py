"""Actions that clients offer to other clients: goals, feedback and results pass from one to the other, unchecked.

The types of such an action need not be known here. A goal ends when its action is withdrawn or the client that offers
it is gone; a client that sent a goal and is gone has its goal canceled, as with our own actions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mbf_ros.rosbridge.client import Client
from mbf_ros.rosbridge.protocol import Operation, OperationError, frame, text_in

MAX_OFFERS = 100


@dataclass(eq=False)
class ForwardedGoal:
    """A goal on its way between two clients.

    Attributes
    ----------
    id : str
        What the sender calls it.
    cancel : callable
        Asks the client that offers the action to cancel it; takes a reason, which the protocol has no field for.
    """

    sender: Client
    id: str
    wants_feedback: bool
    cancel: Callable[[str], object]

    @property
    def is_awaited(self) -> bool:
        """Whether its sender is there and waits for its end."""
        return self.sender.goals.get(self.id) is self


@dataclass(eq=False)
class Offer:
    """An action, who offers it, and its unfinished goals by the ids that the offering client knows them by."""

    client: Client
    type: str
    goals: dict[str, ForwardedGoal]


class OfferedActions:
    """Offers by the names of the actions; used on the event loop only."""

    def __init__(self) -> None:
        self.offers: dict[str, Offer] = {}
        self._count = 0

    def offer(self, client: Client, name: str, type_name: str) -> None:
        """Let a client offer an action; raises OperationError where there are too many.

        It takes over what another one offers: that may be its own former connection, whose end is not known here yet.
        """
        found = self.offers.get(name)
        if found is not None and found.client is client:
            return
        if found is not None:
            self.withdraw(found.client, name, "another client offers the action now")
        if len(self.offers) >= MAX_OFFERS:
            raise OperationError(f"advertise_action: there are {MAX_OFFERS} offered actions already")
        self.offers[name] = Offer(client, type_name, {})

    def withdraw(self, client: Client, name: str, reason: str = "the action was withdrawn") -> None:
        """End an offer of a client, and the goals that it leaves unfinished."""
        found = self.offers.get(name)
        if found is None or found.client is not client:
            return
        del self.offers[name]
        for goal in found.goals.values():
            self._end(goal, name, {"values": reason, "status": 0, "result": False})

    def forget(self, client: Client) -> None:
        """End all offers of a client that is gone."""
        for name in list(self.offers):
            self.withdraw(client, name, "the client that offers the action has disconnected")

    def send_goal(self, sender: Client, name: str, goal_id: str, operation: Operation) -> None:
        """Pass a goal on to the client that offers its action."""
        offer = self.offers[name]
        self._count += 1
        passed_id = f"action_goal:{name}:{self._count}"

        def cancel(reason: str) -> None:
            offer.client.outbox.answer(frame("cancel_action_goal", id=passed_id, action=name))

        goal = ForwardedGoal(sender, goal_id, operation.get("feedback") is True, cancel)
        offer.goals[passed_id] = goal
        sender.goals[goal_id] = goal
        fields = {"action": name, "action_type": offer.type, "args": operation.get("args", {})}
        offer.client.outbox.answer(frame("send_action_goal", id=passed_id, **fields, feedback=goal.wants_feedback))

    def feedback(self, client: Client, name: str, operation: Operation) -> None:
        """Pass a feedback on; one of a goal that has ended is dropped."""
        goal = self._offer_of(client, name).goals.get(text_in(operation, "id"))
        if goal is not None and goal.wants_feedback and goal.is_awaited:
            text = frame("action_feedback", id=goal.id, action=name, values=operation.get("values", {}))
            goal.sender.outbox.newest(("feedback", goal.id), text)

    def result(self, client: Client, name: str, operation: Operation) -> None:
        """Pass a result on; raises OperationError where no goal of this id is unfinished."""
        goal = self._offer_of(client, name).goals.pop(text_in(operation, "id"), None)
        if goal is None:
            raise OperationError(f"action_result: {name} has no unfinished goal {operation['id']!r}")
        self._end(goal, name, {key: operation.get(key) for key in ("values", "status", "result")})

    def _offer_of(self, client: Client, name: str) -> Offer:
        found = self.offers.get(name)
        if found is None or found.client is not client:
            raise OperationError(f"this client does not offer the action {name}")
        return found

    @staticmethod
    def _end(goal: ForwardedGoal, name: str, fields: dict[str, object]) -> None:
        if goal.is_awaited:
            del goal.sender.goals[goal.id]
            goal.sender.outbox.answer(frame("action_result", id=goal.id, action=name, **fields))
