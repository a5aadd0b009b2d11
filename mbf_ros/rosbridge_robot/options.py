"""How a robot behind a rosbridge is reached, heard and driven."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum


class TimeSource(str, Enum):
    """What shows the time in which the robot stamps its messages."""

    CALENDAR = "calendar"
    """The calendar of this computer; both computers are set by NTP."""
    ODOM = "odom"
    """The stamps of ``/odom`` as they arrive, for a robot whose calendar is not set; the fastest message counts."""
    SIMULATED = "clock"
    """The topic ``/clock`` of a simulation; all waits of the navigation are simulated then."""


@dataclass(frozen=True)
class LinkOptions:
    """Options of the two connections.

    Attributes
    ----------
    secret : str
        Of a server that asks for ``auth``; empty if it does not.
    open_timeout : float
        Longest time [s] to be connected.
    ping_period : float
        Time [s] between two pings, and until one without an answer counts as the end of the connection.
    first_delay, longest_delay : float
        Time [s] before the first try to connect again, and the longest; it doubles from try to try.
    max_message : int
        Longest message of the robot [bytes].
    """

    secret: str = field(default="", repr=False)
    open_timeout: float = 5.0
    ping_period: float = 5.0
    first_delay: float = 0.25
    longest_delay: float = 8.0
    max_message: int = 64_000_000


@dataclass(frozen=True)
class RobotOptions:
    """Options of the robot.

    Attributes
    ----------
    stamped_commands : bool
        Publish ``/cmd_vel`` as TwistStamped instead of Twist.
    max_silence : float, optional
        Longest time [s] without odometry, transforms or a sensor; that of ``command_timeout`` if None.
    sensors : mapping of str to (str, str)
        Type, one of ``messages.sensors.SENSORS``, and source in the configuration, by topic.
    cloud_period : float
        Least time [s] between two clouds of a topic that the robot is asked for.
    time_to_end : float
        Longest time [s] for goals to end and their results to be sent when the navigator ends.
    time_to_send : float
        Longest time [s] for the last command to be sent.
    """

    link: LinkOptions = field(default_factory=LinkOptions)
    stamped_commands: bool = False
    max_silence: float | None = None
    sensors: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    cloud_period: float = 0.1
    time: TimeSource = TimeSource.CALENDAR
    time_to_end: float = 2.0
    time_to_send: float = 0.5
