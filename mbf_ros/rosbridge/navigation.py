"""What clients find: the actions and services of mbf_msgs and Nav2 by their usual names, served by our navigator."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from mbf_abstract.config.known_keys import key_hint
from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.navigator import Navigator
from mbf_ros.map_messages import Output
from mbf_ros.messages import mbf_actions
from mbf_ros.messages.action_mapping import ActionMapping
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.json_text import json_text
from mbf_ros.messages.mbf_queries import MAP_QUESTIONS, MapQuestion
from mbf_ros.messages.nav2 import actions as nav2_actions
from mbf_ros.messages.nav2 import waypoints as nav2_waypoints
from mbf_ros.robot_inputs import RobotInputs
from mbf_ros.rosbridge.actions import ServedAction
from mbf_ros.rosbridge.bridge import Bridge
from mbf_ros.rosbridge.protocol import absolute
from mbf_ros.rosbridge.services import Service

NODE = "/move_base_flex"
ACTIONS: dict[str, ActionMapping[Any, Any]] = {
    f"{NODE}/get_path": mbf_actions.GET_PATH,
    f"{NODE}/exe_path": mbf_actions.EXE_PATH,
    f"{NODE}/recovery": mbf_actions.RECOVERY,
    f"{NODE}/move_base": mbf_actions.MOVE_BASE,
    "/compute_path_to_pose": nav2_actions.COMPUTE_PATH_TO_POSE,
    "/compute_path_through_poses": nav2_actions.COMPUTE_PATH_THROUGH_POSES,
    "/follow_path": nav2_actions.FOLLOW_PATH,
    "/navigate_to_pose": nav2_actions.NAVIGATE_TO_POSE,
    "/navigate_through_poses": nav2_waypoints.NAVIGATE_THROUGH_POSES,
    "/follow_waypoints": nav2_waypoints.FOLLOW_WAYPOINTS,
    "/smooth_path": nav2_actions.SMOOTH_PATH,
}


def serve_navigator(bridge: Bridge, navigator: Navigator, context: MessageContext) -> None:
    """Add the actions, services and goal topics of a navigator to a bridge."""
    for name, mapping in ACTIONS.items():
        bridge.actions.actions[name] = ServedAction(mapping, navigator.send)
        bridge.services.services[f"{name}/_action/cancel_goal"] = _cancel_service(bridge, name)
    inputs = RobotInputs(navigator.server.runtime.clock.now, lambda: context)
    for one in (*inputs.of_maps(navigator.server), *inputs.of_users(navigator.send)):
        bridge.topics.add_input(absolute(one.topic), one.type, one.take)
    for name, question in MAP_QUESTIONS.items():
        bridge.services.services[f"{NODE}/{name}"] = _map_service(navigator, question, context)
    server = navigator.server
    bridge.services.services |= {
        f"{NODE}/clear_costmaps": Service("std_srvs/srv/Empty", lambda _: _clear(navigator), takes_time=True),
        f"{NODE}/cancel_all": _trigger(lambda: server.cancel_all("canceled by a client"), "all goals canceled"),
        f"{NODE}/pause": _trigger(server.pause_all, "all goals paused"),
        f"{NODE}/resume": _trigger(server.resume_all, "all goals go on"),
    }


def node_topic(output: Output) -> str:
    """Return the full name of a topic, with that of the node for ``~``."""
    return absolute(output.topic.replace("~", NODE, 1))


class ServerParameters:
    """The parameters of the navigation as those of the node, by name, their values as JSON."""

    def __init__(self, navigator: Navigator) -> None:
        self._server = navigator.server

    def names(self) -> list[str]:
        """Full names of all parameters, sorted."""
        return sorted(f"{NODE}/{name}" for name in NavigationParameters.model_fields)

    def get(self, name: str, default: str) -> str:
        """Return a value as JSON, ``default`` if there is no such parameter."""
        key = _key(name)
        if key not in NavigationParameters.model_fields:
            return default
        value: Any = self._server.runtime.parameters.model_dump(mode="json")[key]
        return json_text(value)

    def set(self, name: str, value: str) -> None:
        """Change a parameter; raises ValueError where it is not known, not legal or read only at the start."""
        key = _key(name)
        if key not in NavigationParameters.model_fields:
            raise ValueError(f"there is no parameter {name!r}; {key_hint(key, NavigationParameters.model_fields)}")
        self._server.set_parameters(**{key: json.loads(value)})


def _key(name: str) -> str:
    """Name of a parameter without its node, whether ROS 1 or ROS 2 has put the two together."""
    return name.removeprefix(NODE).lstrip("/:.")


def _map_service(navigator: Navigator, question: MapQuestion, context: MessageContext) -> Service:
    def ask(request: Message) -> Message:
        return question.ask(navigator.server, request, context)

    return Service(question.type, ask, takes_time=True, changes_nothing=True)


def _cancel_service(bridge: Bridge, name: str) -> Service:
    """The service behind ``cancelAllGoals`` of roslib: action_msgs/CancelGoal for all goals of an action."""

    def cancel(request: Message) -> Message:
        bridge.actions.cancel_all(name)
        return {"return_code": 0, "goals_canceling": []}

    return Service("action_msgs/srv/CancelGoal", cancel)


def _clear(navigator: Navigator) -> Message:
    navigator.server.queries.clear_map()
    return {}


def _trigger(call: Callable[[], None], text: str) -> Service:
    def run(request: Message) -> Message:
        call()
        return {"success": True, "message": text}

    return Service("std_srvs/srv/Trigger", run)
