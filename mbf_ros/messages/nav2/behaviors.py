"""Spin, BackUp, DriveOnHeading and Wait of nav2_msgs: recoveries of ours with parameters that the goal brings.

The behaviour is the first loaded recovery of the type, with its own speeds of turning, checks and tolerances; what the
goal names replaces its parameters for this run. A robot whose configuration has none of the type does not do it: what
a robot may do is said in its configuration.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from mbf_abstract.goals.goal_types import RecoveryGoal
from mbf_abstract.goals.result_types import RecoveryResultMessage
from mbf_abstract.maps.recoveries.back_up import BackUpRecovery
from mbf_abstract.maps.recoveries.drive_on_heading import DriveOnHeadingRecovery
from mbf_abstract.maps.recoveries.rotate import RotateRecovery
from mbf_abstract.maps.recoveries.wait import WaitRecovery
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import AbstractRecovery, PluginKind
from mbf_abstract.server.plugin_table import PluginTable
from mbf_ros.messages.action_mapping import ActionMapping, RefusedGoal
from mbf_ros.messages.geometry import MessageContext, duration, seconds_of
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.nav2 import codes
from mbf_ros.messages.nav2.actions import error_msg, unsupported

Numbers = dict[str, float]


@dataclass(frozen=True)
class Behavior:
    """One action of Nav2.

    Attributes
    ----------
    action : str
        Its type.
    recovery, recovery_type : type, str
        What does it here, and its name in a configuration.
    codes : type of enum
        Its error codes.
    parameters : callable
        Parameters of the recovery by a goal; raises RefusedGoal.
    """

    action: str
    recovery: type[AbstractRecovery]
    recovery_type: str
    codes: type[IntEnum]
    parameters: Callable[[Message], Numbers]

    def mapping(self, plugins: PluginTable) -> ActionMapping[RecoveryGoal, RecoveryResultMessage]:
        """Return the mapping for a server with these plugins."""

        def goal_of(message: Message, context: MessageContext) -> RecoveryGoal:
            unsupported(message, RecoveryOutcome.FAILURE, "disable_collision_checks")
            loaded = plugins.all_of(PluginKind.RECOVERY)
            name = next((one.name for one in loaded if isinstance(one.instance, self.recovery)), None)
            if name is None:
                text = f"no recovery of type {self.recovery_type!r} is loaded; add one to recovery_behaviors"
                raise RefusedGoal(RecoveryOutcome.INVALID_PLUGIN, text)
            return RecoveryGoal(name, parameters=self.parameters(message))

        def result(ended: RecoveryResultMessage, context: MessageContext) -> Message:
            code = codes.behavior_code(self.codes, ended.outcome)
            return {"total_elapsed_time": duration(0.0), "error_code": code, "error_msg": error_msg(ended)}

        return ActionMapping(self.action, goal_of, result, None, RecoveryResultMessage)


def _time_limit(message: Message) -> Numbers:
    """The time that the goal allows; with 0 that of the recovery."""
    allowed = seconds_of(message["time_allowance"])
    return {"time_limit": allowed} if allowed else {}


def _straight(message: Message) -> tuple[float, float]:
    """Distance [m] and speed [m/s] of a goal; raises RefusedGoal where it is not along the heading."""
    target = message["target"]
    if target["y"] or target["z"]:
        text = f"target: expected a point on the robot's x axis, got y {target['y']} m and z {target['z']} m"
        raise RefusedGoal(RecoveryOutcome.FAILURE, text)
    return target["x"], message["speed"]


def _spin(message: Message) -> Numbers:
    return {"angle": message["target_yaw"], **_time_limit(message)}


def _back_up(message: Message) -> Numbers:
    distance, speed = _straight(message)
    return {"distance": abs(distance), "speed": abs(speed), "along_track": False, **_time_limit(message)}


def _drive(message: Message) -> Numbers:
    distance, speed = _straight(message)
    if math.copysign(1.0, distance) != math.copysign(1.0, speed):
        text = f"speed: expected the sign of the distance ({distance} m), got {speed} m/s"
        raise RefusedGoal(RecoveryOutcome.FAILURE, text)
    return {"distance": distance, "speed": abs(speed), **_time_limit(message)}


def _wait(message: Message) -> Numbers:
    return {"duration": seconds_of(message["time"]), "random_extra": 0.0}


BEHAVIORS = {
    "spin": Behavior("nav2_msgs/action/Spin", RotateRecovery, "rotate", codes.SpinCode, _spin),
    "backup": Behavior("nav2_msgs/action/BackUp", BackUpRecovery, "back_up", codes.BackUpCode, _back_up),
    "drive_on_heading": Behavior(
        "nav2_msgs/action/DriveOnHeading", DriveOnHeadingRecovery, "drive_on_heading", codes.DriveOnHeadingCode, _drive
    ),
    "wait": Behavior("nav2_msgs/action/Wait", WaitRecovery, "wait", codes.WaitCode, _wait),
}
"""By the names of the actions."""


def behavior_mappings(plugins: PluginTable) -> dict[str, ActionMapping[Any, Any]]:
    """Return the mappings of all behaviours for a server with these plugins."""
    return {name: behavior.mapping(plugins) for name, behavior in BEHAVIORS.items()}
