"""The robot of a scenario behind a rosbridge, as a real one is: it has no navigation, and does what ``/cmd_vel`` says.

It publishes transforms, odometry and scans. Commands pass its own velocity gate: limits hold, and when none has come
for ``command_timeout`` it stops by itself, as the driver of a robot should.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import unix_seconds
from mbf_abstract.time.ticker import Ticker
from mbf_ros.messages.commands import command_of, command_type
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message
from mbf_ros.rosbridge.authentication import Authentication
from mbf_ros.rosbridge.bridge import Bridge
from mbf_ros.rosbridge.protocol import frame
from mbf_ros.rosbridge.serving import BridgeOptions, RosbridgeServer, rosbridge_server, take_initial_poses
from mbf_ros.rosbridge_robot.robot_state import RobotState

PERIOD = 0.05  # s between two looks at the robot
DRIVER = "cmd_vel"


@contextmanager
def serve_robot(session: NavigationSession, options: BridgeOptions | None = None) -> Iterator[RosbridgeServer]:
    """Serve the robot of a session whose navigator gets no goals; its clock must be a wall clock.

    Of the options those of the server hold, ``cancel_on_disconnect``, and whether commands are stamped.

    Raises
    ------
    ServerError
        The package websockets is missing, or nothing can listen there.
    ValueError
        Somebody else drives the robot.
    """
    options = options or BridgeOptions()
    clock, events, server = session.clock, session.events, session.navigator.server
    lease = server.runtime.gate.acquire(DRIVER)
    if lease is None:
        raise ValueError(f"the robot is driven by {server.runtime.gate.holder!r} already")
    context = MessageContext(server.runtime.robot.global_frame, unix_seconds() - clock.now())
    authentication = Authentication(options.server.access.roles, unix_seconds)
    bridge = Bridge(clock, events, context, authentication, options.cancel_on_disconnect)
    served = rosbridge_server(bridge, events, options.server)

    def drive(message: Message) -> None:
        lease.send(command_of(message, options.stamped_commands))

    def send(topic: str, message: Message) -> None:
        if bridge.topics.is_wanted(topic):
            served.post(bridge.topics.send, topic, frame("publish", topic=topic, msg=message))

    bridge.topics.add_input("/cmd_vel", command_type(options.stamped_commands), drive)
    take_initial_poses(bridge, session, context)
    with ExitStack() as closing:
        closing.callback(lease.release)
        state = RobotState(session, bridge.topics, context, send)
        closing.callback(state.close)
        closing.callback(Ticker(clock, events, state.publish, PERIOD, "robot state").stop)
        closing.callback(served.close)
        served.start()
        yield served
