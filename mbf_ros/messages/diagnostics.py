"""The state of a navigator as diagnostic_msgs/DiagnosticArray: inputs, maps, plugins and the velocity gate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import IntEnum

from mbf_abstract.drive.commands import command_data
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.map_server import MapServer
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message

NODE = "move_base_flex"


class Level(IntEnum):
    """How good it is, as in diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


def diagnostics(
    server: AbstractNavigationServer, inputs: Mapping[str, str], stamp: float, context: MessageContext
) -> Message:
    """Return the state of a server at ``stamp`` [s].

    Parameters
    ----------
    inputs : mapping of str to str
        What is wrong with each topic that must come, empty for one that comes, by topic.
    """
    states = [*_inputs(inputs), *_maps(server), *_plugins(server), _gate(server)]
    return {"header": context.header("", stamp), "status": states}


def _inputs(inputs: Mapping[str, str]) -> Iterator[Message]:
    for topic, problem in inputs.items():
        yield _status(f"input {topic}", Level.STALE if problem else Level.OK, problem or "comes")


def _maps(server: AbstractNavigationServer) -> Iterator[Message]:
    """Each map, or what the server says of all of them."""
    names = tuple(server.served) if isinstance(server, MapServer) else ()
    problems = {name: server.map_problem(name) for name in names} if isinstance(server, MapServer) else {}
    for name, problem in (problems or {"map": server.map_problem()}).items():
        values = {}
        if isinstance(server, MapServer):
            served = server.served[name].map
            values = {"frame": served.frame_id, "layers": ", ".join(served.layers)}
            values["sources"] = ", ".join(served.source_names)
        label = name if name == "map" else f"map {name}"
        yield _status(label, Level.STALE if problem else Level.OK, problem or "current", **values)


def _plugins(server: AbstractNavigationServer) -> Iterator[Message]:
    for kind in PluginKind:
        for plugin in server.plugins.all_of(kind):
            bad = plugin.quarantined
            message = bad or (f"in use by {plugin.user}" if plugin.in_use else "ready")
            yield _status(plugin.title, Level.ERROR if bad else Level.OK, message, type=plugin.spec.type_name)


def _gate(server: AbstractNavigationServer) -> Message:
    gate = server.runtime.gate
    level, message = Level.OK, f"driven by {gate.holder}" if gate.holder else "nobody drives"
    if gate.closed:
        level, message = Level.ERROR, "closed: the robot stands for good"
    last = " ".join(f"{number:g}" for number in command_data(gate.last_command))
    return _status("velocity gate", level, message, last_command=last, command_timeout=f"{gate.command_timeout:g} s")


def _status(name: str, level: Level, message: str, **values: str) -> Message:
    pairs = [{"key": key, "value": value} for key, value in values.items()]
    return {"level": int(level), "name": f"{NODE}: {name}", "message": message, "hardware_id": "", "values": pairs}
