"""The services of rosapi: what topics, services, actions and parameters there are, and of which types."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

from mbf_abstract.config.findings import describe_value
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message, MessageError, fields_of, full_name, known_types
from mbf_ros.rosbridge.bridge import Bridge
from mbf_ros.rosbridge.services import Service

ANY_LENGTH, NO_LIST = 0, -1


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
    """Add the services of rosapi to a bridge."""
    topics, services, actions = bridge.topics, bridge.services.services, bridge.actions.actions

    def topic_lists(_: Message) -> Message:
        types = topics.types()
        return {"topics": list(types), "types": list(types.values())}

    def node_details(_: Message) -> Message:
        ours = [name for name in topics.types() if topics[name].is_ours]
        inputs = [name for name in topics.types() if topics[name].on_message is not None]
        return {"subscribing": inputs, "publishing": ours, "services": sorted(services)}

    def publishers(request: Message) -> Message:
        name = request.get("topic")
        known = name in topics.types()
        return {"publishers": [node] if known and topics[name].is_ours else []}  # type: ignore[index]

    def subscribers(request: Message) -> Message:
        name = request.get("topic")
        known = name in topics.types()
        return {"subscribers": [node] if known and topics[name].on_message is not None else []}  # type: ignore[index]

    def set_parameter(request: Message) -> Message:
        parameters.set(_text(request, "name"), _text(request, "value"))
        return {"successful": True, "reason": ""}

    reading: dict[str, Callable[[Message], Message]] = {
        "Topics": topic_lists,
        "TopicType": lambda request: {"type": topics.types().get(str(request.get("topic")), "")},
        "TopicsForType": lambda request: {
            "topics": [name for name, kind in topics.types().items() if kind == full_name(str(request.get("type")))]
        },
        "Services": lambda _: {"services": sorted(services)},
        "ServiceType": lambda request: {"type": _type_of(services.get(str(request.get("service"))))},
        "ServicesForType": lambda request: {
            "services": sorted(name for name, one in services.items() if one.type == request.get("type"))
        },
        "ActionServers": lambda _: {"action_servers": sorted({*actions, *bridge.offered.offers})},
        "Nodes": lambda _: {"nodes": [node]},
        "NodeDetails": node_details,
        "Publishers": publishers,
        "Subscribers": subscribers,
        "GetTime": lambda _: {"time": _of_both(context.time(now()))},
        "GetParamNames": lambda _: {"names": parameters.names()},
        "GetParam": lambda request: {
            "value": parameters.get(
                _text(request, "name"), str(request.get("default") or request.get("default_value", ""))
            )
        },
        "HasParam": lambda request: {"exists": request.get("name") in parameters.names()},
        "MessageDetails": lambda request: {"typedefs": list(_typedefs(str(request.get("type")), set()))},
        "ServiceRequestDetails": lambda request: _details(f"{request.get('type')}_Request"),
        "ServiceResponseDetails": lambda request: _details(f"{request.get('type')}_Response"),
    }
    for name, call in reading.items():
        services[f"/rosapi/{_snake(name)}"] = Service(f"rosapi_msgs/srv/{name}", call, changes_nothing=True)
    services["/rosapi/set_param"] = Service("rosapi_msgs/srv/SetParam", set_parameter)


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
