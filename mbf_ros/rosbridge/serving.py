"""A navigation session on a rosbridge: everything that a client finds, from one call.

Example
-------
>>> with serve_session(session) as server:
...     print(f"roslibpy.Ros('127.0.0.1', {server.port})")
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.access.web_socket_server import Offer, WebSocketServer
from mbf_abstract.event_bus import EventBus
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import unix_seconds
from mbf_abstract.time.ticker import Ticker
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.robot_inputs import RobotInputs
from mbf_ros.rosbridge.actionlib import ActionlibServer
from mbf_ros.rosbridge.authentication import Authentication
from mbf_ros.rosbridge.bridge import Bridge
from mbf_ros.rosbridge.client import Client
from mbf_ros.rosbridge.navigation import NODE, ServerParameters, serve_navigator
from mbf_ros.rosbridge.page import page_files
from mbf_ros.rosbridge.protocol import absolute
from mbf_ros.rosbridge.publishing import Publisher
from mbf_ros.rosbridge.rosapi import serve_rosapi
from mbf_ros.rosbridge_robot.topic_robot import WATCH_PERIOD, TopicRobot

PORT = 9090
RosbridgeServer = WebSocketServer[Client]
"""A server whose clients speak the rosbridge protocol."""


def rosbridge_server(bridge: Bridge, events: EventBus, options: ServerOptions) -> RosbridgeServer:
    """Return a server of a bridge and its page, not started yet."""
    offer = Offer("rosbridge", extra="bridge", origin_option="--allow-origin", pages=page_files(), takes_auth=True)
    return WebSocketServer(bridge, events, options, offer)


def take_initial_poses(bridge: Bridge, session: NavigationSession, context: MessageContext) -> None:
    """Let clients say where a simulated robot is."""
    for one in RobotInputs(session.clock.now, lambda: context).of_localization(session.set_initial_pose):
        bridge.topics.add_input(absolute(one.topic), one.type, one.take)


@dataclass(frozen=True)
class BridgeOptions:
    """What is served, and how.

    Attributes
    ----------
    server : ServerOptions
        Where and for whom.
    cancel_on_disconnect : bool
        Whether the goals of a client that is gone are canceled, and the robot stops.
    stamped_commands : bool
        Publish ``/cmd_vel`` as TwistStamped, as Nav2 does from Kilted on, instead of Twist.
    map_period : float
        Least time [s] between two messages of a map.
    sensors : mapping of str to (str, str)
        Of a ``TopicRobot``: type and source in the configuration of each topic of a sensor.
    """

    server: ServerOptions = field(default_factory=lambda: ServerOptions(port=PORT))
    cancel_on_disconnect: bool = True
    stamped_commands: bool = False
    sensors: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    map_period: float = 1.0


@contextmanager
def serve_session(
    session: NavigationSession, options: BridgeOptions | None = None, robot: TopicRobot | None = None
) -> Iterator[RosbridgeServer]:
    """Serve a session whose navigator is there; its clock must be a wall clock.

    Parameters
    ----------
    robot : TopicRobot, optional
        The session's driver, if the robot is a client; else the robot is simulated, and its tf, odometry and scans are
        published.

    Raises
    ------
    ServerError
        The package websockets is missing, or nothing can listen there.
    """
    options = options or BridgeOptions()
    clock, events, navigator = session.clock, session.events, session.navigator
    runtime = navigator.server.runtime
    context = MessageContext(runtime.robot.global_frame, unix_seconds() - clock.now())
    authentication = Authentication(options.server.access.roles, unix_seconds)
    bridge = Bridge(clock, events, context, authentication, options.cancel_on_disconnect)
    server = rosbridge_server(bridge, events, options.server)
    serve_navigator(bridge, navigator, context)
    serve_rosapi(bridge, ServerParameters(navigator), NODE, context, clock.now)
    actionlib = ActionlibServer(bridge.topics, navigator, context, clock.now, server.post)
    if robot is not None:
        robot.listen(bridge.topics, context, navigator.server, options.sensors)
    else:
        take_initial_poses(bridge, session, context)
    with ExitStack() as closing:
        publisher = Publisher(
            session,
            bridge.topics,
            context,
            server.post,
            actionlib,
            simulated=robot is None,
            stamped_commands=options.stamped_commands,
            map_period=options.map_period,
            problems=dict if robot is None else robot.problems,
        )
        closing.callback(publisher.close)
        if robot is not None:
            robot.on_command.append(publisher.send_command)
            closing.callback(robot.on_command.remove, publisher.send_command)
            closing.callback(_silence_watch(session, robot).stop)
        closing.callback(server.close)
        if robot is not None:  # while the robot can still hear it
            closing.callback(runtime.gate.close, "the bridge is closed")
        server.start()
        yield server


def _silence_watch(session: NavigationSession, robot: TopicRobot) -> Ticker:
    """Stop the robot at once where something fails to come from it."""

    def look() -> None:
        if problem := robot.problem():
            session.navigator.server.runtime.gate.ask_stop(problem)

    return Ticker(session.clock, session.events, look, WATCH_PERIOD, "silence watch")
