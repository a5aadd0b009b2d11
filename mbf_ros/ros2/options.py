"""How the node is connected to its robot, and how long it may take to end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class NodeOptions:
    """Options of the node.

    Attributes
    ----------
    stamped_commands : bool
        Publish ``cmd_vel`` as TwistStamped instead of Twist.
    max_silence : float, optional
        Longest time [s] without odometry, transforms, a sensor or simulated time; that of ``command_timeout`` if None.
    sensors : mapping of str to (str, str)
        Type, one of ``messages.sensors.SENSORS``, and source in the configuration, by topic.
    keep_goals : bool
        Let a goal go on when its client is gone, instead of canceling it.
    ros_arguments : sequence of str
        As after ``--ros-args``: remappings, parameters, log level.
    nav2 : bool, optional
        Offer Nav2's names; None = where nav2_msgs is installed.
    stands_for_amcl : bool
        Answer for the node ``amcl``, too, for which Nav2's clients wait; see ``nav2_services``. Offers Nav2's names.
    map_period : float
        Least time [s] between two messages of a map.
    time_to_end : float
        Longest time [s] for goals to end and their results to be sent when the node ends.
    time_to_send : float
        Longest time [s] for the last command to reach all who listen.

    Raises
    ------
    ValueError
        The node is to answer for ``amcl`` without Nav2's names.
    """

    stamped_commands: bool = False
    max_silence: float | None = None
    sensors: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    keep_goals: bool = False
    ros_arguments: tuple[str, ...] = ()
    nav2: bool | None = None
    stands_for_amcl: bool = False
    map_period: float = 1.0
    time_to_end: float = 2.0
    time_to_send: float = 0.5

    def __post_init__(self) -> None:
        if self.stands_for_amcl and self.nav2 is False:
            raise ValueError("--amcl answers clients of Nav2, and --no-nav2 leaves out what they ask for")
        object.__setattr__(self, "nav2", self.stands_for_amcl or self.nav2)
