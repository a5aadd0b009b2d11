"""The services of rosapi: what topics, services, actions and parameters there are, and of which types."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Protocol

from mbf_abstract.config.findings import describe_value
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message, MessageError, fields_of, full_name, known_types
from mbf_ros.rosbridge.bridge import Bridge
from mbf_ros.rosbridge.services import Service
from mbf_ros.rosbridge.topics import TopicTable

ANY_LENGTH, NO_LIST = 0, -1

Calls = dict[str, Callable[[Message], Message]]
"""What services do with a request, by the names of their types."""


class Parameters(Protocol):
    """What can be asked for and set by name; values are JSON."""

    def names(self) -> list[str]:
        """Names of all parameters."""

    def get(self, name: str, default: str) -> str:
        """Return a value, ``default`` where there is none."""

    def set(self, name: str, value: str) -> None:
        """Change a value; raises ValueError."""


def serve_rosapi(
    bridge: Bridge, parameters: Parameters, node: str, context: MessageContext, now: Callable[[], float]
) -> None:
    """Add the services of rosapi to a bridge.

    Parameters
    ----------
    node : str
        Name of the navigator's node, the only one there is.
    now : callable
        Time [s] on the clock of the navigator.
    """
    services = bridge.services.services
    reading: Calls = {
        **_about_topics(bridge.topics, node),
        **_about_services(services),
        **_about_parameters(parameters),
        **_about_types(),
        "ActionServers": lambda _: {"action_servers": sorted({*bridge.actions.actions, *bridge.offered.offers})},
        "Nodes": lambda _: {"nodes": [node]},
        "NodeDetails": lambda _: {**_used_topics(bridge.topics), "services": sorted(services)},
        "GetTime": lambda _: {"time": _of_both(context.time(now()))},
    }
    for name, call in reading.items():
        services[f"/rosapi/{_snake(name)}"] = Service(f"rosapi_msgs/srv/{name}", call, changes_nothing=True)

    def set_parameter(request: Message) -> Message:
        parameters.set(_text(request, "name"), _text(request, "value"))
        return {"successful": True, "reason": ""}

    services["/rosapi/set_param"] = Service("rosapi_msgs/srv/SetParam", set_parameter)


def _about_topics(topics: TopicTable, node: str) -> Calls:
    def node_if(direction: str, request: Message) -> list[str]:
        return [node] if request.get("topic") in _used_topics(topics)[direction] else []

    def of_type(request: Message) -> list[str]:
        wanted = full_name(str(request.get("type")))
        return [name for name, kind in topics.types().items() if kind == wanted]

    return {
        "Topics": lambda _: {"topics": list(topics.types()), "types": list(topics.types().values())},
        "TopicType": lambda request: {"type": topics.types().get(str(request.get("topic")), "")},
        "TopicsForType": lambda request: {"topics": of_type(request)},
        "Publishers": lambda request: {"publishers": node_if("publishing", request)},
        "Subscribers": lambda request: {"subscribers": node_if("subscribing", request)},
    }


def _used_topics(topics: TopicTable) -> dict[str, list[str]]:
    """Names of the topics that the navigator listens to, and of those that it publishes."""
    names = list(topics.types())
    return {
        "subscribing": [name for name in names if topics[name].on_message is not None],
        "publishing": [name for name in names if topics[name].is_ours],
    }


def _about_services(services: Mapping[str, Service]) -> Calls:
    def of_type(request: Message) -> list[str]:
        return sorted(name for name, one in services.items() if one.type == request.get("type"))

    return {
        "Services": lambda _: {"services": sorted(services)},
        "ServiceType": lambda request: {"type": _type_of(services.get(str(request.get("service"))))},
        "ServicesForType": lambda request: {"services": of_type(request)},
    }


def _about_parameters(parameters: Parameters) -> Calls:
    def value(request: Message) -> str:
        default = str(request.get("default") or request.get("default_value", ""))
        return parameters.get(_text(request, "name"), default)

    return {
        "GetParamNames": lambda _: {"names": parameters.names()},
        "GetParam": lambda request: {"value": value(request)},
        "HasParam": lambda request: {"exists": request.get("name") in parameters.names()},
    }


def _about_types() -> Calls:
    return {
        "MessageDetails": lambda request: {"typedefs": list(_typedefs(str(request.get("type")), set()))},
        "ServiceRequestDetails": lambda request: _details(f"{request.get('type')}_Request"),
        "ServiceResponseDetails": lambda request: _details(f"{request.get('type')}_Response"),
    }


def _text(request: Message, name: str) -> str:
    """A text of a request; raises MessageError where it is missing or none."""
    value = request.get(name)
    if not isinstance(value, str):
        raise MessageError(f"{name}: expected a text, got {describe_value(value)}")
    return value


def _of_both(time: Message) -> Message:
    """A time with the fields of ROS 2, and of ROS 1, which roslibpy reads here."""
    return {**time, "secs": time["sec"], "nsecs": time["nanosec"]}


def _type_of(service: Service | None) -> str:
    return "" if service is None else service.type


def _snake(name: str) -> str:
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name)[1:]


def _details(type_name: str) -> Message:
    return {"typedefs": list(_typedefs(type_name, set())) if type_name in known_types() else []}


def _typedefs(type_name: str, listed: set[str]) -> Iterator[Message]:
    """A type and then those of its fields, each once, as rosapi_msgs/TypeDef; raises MessageError if not known."""
    name, fields = full_name(type_name), fields_of(type_name)
    listed.add(name)
    lengths = [NO_LIST if field.length is None else field.length or ANY_LENGTH for field in fields]
    yield {
        "type": name,
        "fieldnames": [field.name for field in fields],
        "fieldtypes": [field.type for field in fields],
        "fieldarraylen": lengths,
        "examples": ["[]" if field.length is not None else "{}" if "/" in field.type else "" for field in fields],
        "constnames": [],
        "constvalues": [],
    }
    for field in fields:
        if "/" in field.type and field.type not in listed:
            yield from _typedefs(field.type, listed)
