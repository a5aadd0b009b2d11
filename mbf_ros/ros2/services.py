"""Services of the node: questions to the map by the types of mbf_msgs, and clear_costmaps, pause, resume, cancel_all.

A question is answered on a thread of its own, because a long path takes a while and inputs must not wait for it. A
service of ROS 2 cannot fail: what cannot be answered is logged, and answered as UNKNOWN.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mbf_abstract.event_values import error_text
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.mbf_queries import MAP_QUESTIONS, MapQuestion
from mbf_ros.ros2.conversion import fill, interface_class, to_dict
from mbf_ros.ros2.running import settle

MAX_CALLS = 20
"""How many questions may be worked on at a time."""


class ServedQueries:
    """All services of a navigation server on a node; ``context`` as in ``ServedAction``.

    Attributes
    ----------
    group : rclpy.callback_groups.CallbackGroup
        Of what need not wait for the other callbacks of the node.
    """

    def __init__(self, node: Any, server: AbstractNavigationServer, context: Callable[[], MessageContext]) -> None:
        self._node, self._server, self._context = node, server, context
        from rclpy.callback_groups import ReentrantCallbackGroup

        self._calls = 0
        self.group = ReentrantCallbackGroup()  # in the group of the node all inputs would wait for an answer
        for name, question in MAP_QUESTIONS.items():
            self.offer(f"~/{name}", question)
        self.serve("std_srvs/srv/Empty", "~/clear_costmaps", self._clear, {})
        trigger = interface_class("std_srvs/srv/Trigger")
        for name, call, text in (
            ("cancel_all", lambda: server.cancel_all("canceled by a client"), "all goals canceled"),
            ("pause", server.pause_all, "all goals paused"),
            ("resume", server.resume_all, "all goals go on"),
        ):
            node.create_service(trigger, f"~/{name}", self._triggering(call, text), callback_group=self.group)

    def serve(self, type_name: str, name: str, answer: Callable[[Any], Message], no_answer: Message) -> None:
        """Offer a service that is answered on a thread of its own; by ``no_answer`` where ``answer`` raises."""

        async def call(request: Any, response: Any) -> Any:
            values = await self._on_thread(lambda: answer(request), name)
            return fill(response, no_answer if values is None else values)

        self._node.create_service(interface_class(type_name), name, call, callback_group=self.group)

    def offer(self, name: str, question: MapQuestion) -> None:
        """Offer the service of a question."""

        def answer(request: Any) -> Message:
            return question.ask(self._server, to_dict(request), self._context())

        self.serve(question.type, name, answer, question.no_answer)

    def _clear(self, request: Any) -> Message:
        self._server.queries.clear_map()
        return {}

    @staticmethod
    def _triggering(call: Callable[[], None], text: str) -> Callable[..., Any]:
        def trigger(request: Any, response: Any) -> Any:
            call()
            return fill(response, {"success": True, "message": text})

        return trigger

    async def _on_thread(self, call: Callable[[], Any], name: str) -> Any:
        """What a call returns on a thread of its own; None where it raises, or too many are running."""
        from rclpy.task import Future

        if self._calls >= MAX_CALLS:
            self._node.get_logger().warning(f"{name}: {MAX_CALLS} calls are being worked on already")
            return None
        executor = self._node.executor
        done = Future(executor=executor)

        def run() -> None:
            try:
                answer = call()
            except Exception as error:  # of a map, a transform or a request
                self._node.get_logger().warning(f"{name}: {type(error).__name__}: {error_text(error)}")
                answer = None
            settle(done, executor, answer)

        self._calls += 1
        self._server.runtime.clock.spawn(run, f"service {name}")
        answer = await done
        self._calls -= 1
        return answer
