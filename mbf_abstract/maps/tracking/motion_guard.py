"""What a recovery asks of the map before each command: how fast it is safe, and what the robot would touch.

Somebody who moves in the way is waited for, as controllers wait: up to the ``max_wait`` of the map's layer. A contact
that has become deeper since it began, though by less than one look at the map shows, must become less deep.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from mbf_abstract.geometry import Command, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.controllers.failures import obstacle_text
from mbf_abstract.maps.layers.obeyed_limits import slow_motion
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.tracking.contact_guard import slower

CREEPING_IN = 0.01
"""A robot in a contact may lie so much deeper [m] than it did; along a wall the depth varies by half of it."""


@dataclass(frozen=True)
class Judgement:
    """What becomes of a command.

    Attributes
    ----------
    command : Command
        So much of it is safe.
    asked : Twist
        As far as speed limits allow it.
    waits_for : str
        Whom the robot waits for; empty if for nobody.
    obstacle : str
        Why the motion must end; empty if it may go on.
    """

    command: Command
    asked: Twist
    waits_for: str = ""
    obstacle: str = ""


class MotionGuard:
    """Judges the commands of one motion.

    Parameters
    ----------
    navigation_map : NavigationMap
        The one the robot moves on.
    limiting : iterable of NavigationMap
        All on which speed limits may stand.
    transforms : TransformBuffer
        Between the robot's frame and theirs.
    obstacle_ahead : callable
        What a robot would touch at a pose, in its own frame, with a command.
    leaves_contacts_within : float
        A contact that has become deeper must be less deep after so long [s]; 0 = it may become deeper.
    """

    def __init__(
        self,
        navigation_map: NavigationMap,
        limiting: Iterable[NavigationMap],
        transforms: TransformBuffer,
        obstacle_ahead: Callable[[Pose, Twist], str],
        leaves_contacts_within: float,
    ) -> None:
        self._map, self._limiting, self._transforms = navigation_map, list(limiting), transforms
        self._obstacle_ahead, self._within = obstacle_ahead, leaves_contacts_within
        self._least_depth = self._waits_since = math.inf

    def judge(self, pose: Pose, here: Pose, moving: Twist, command: Twist, now: float) -> Judgement:
        """Judge a command at ``pose``, which is ``here`` in the frame of the map, of a robot that is ``moving``."""
        asked, forbidden = slow_motion(self._limiting, self._transforms, pose, command)
        share, reason, max_wait = self._map.safe_share(here, moving, asked, now)
        if forbidden:
            return Judgement(Twist(), asked, obstacle=forbidden)
        if share == 0.0:
            self._waits_since = min(self._waits_since, now)
            waited = now - self._waits_since
            ends = waited >= max_wait
            return Judgement(Twist(), asked, reason, f"{reason}; waited {waited:.1f} s for it" if ends else "")
        self._waits_since = math.inf
        obstacle = self._obstacle_ahead(pose, asked) or self._creeps_in(here, asked)
        return Judgement(slower(asked, share), asked, obstacle=obstacle)

    def _creeps_in(self, here: Pose, command: Twist) -> str:
        """Where a robot that lies deeper than it did goes on so; empty if it does not."""
        depth = self._map.contact_depth(here) if self._within > 0.0 else 0.0
        self._least_depth = min(self._least_depth, depth) if depth > 0.0 else math.inf
        if depth <= self._least_depth + CREEPING_IN:
            return ""
        motion = command.vx, command.vy, command.wz, self._within, self._within
        x, y, yaw = arc_poses((here.x, here.y, here.yaw), *motion)[-1].tolist()
        there = replace(Pose.planar(x, y, yaw, here.z), frame_id=here.frame_id)
        return "" if self._map.contact_depth(there) < depth else obstacle_text(f"({here.x:.2f}, {here.y:.2f})")
