"""What all executions and actions share: clock, events, gate, robot, live parameters, and the server's map hooks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from itertools import count
from typing import Any, Protocol

from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.drive.robot import RobotInformation
from mbf_abstract.drive.velocity_gate import VelocityGate
from mbf_abstract.event_bus import EventBus
from mbf_abstract.execution.supervisor import Supervisor
from mbf_abstract.geometry import AckermannCommand, Path, Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.callbacks import CallbackThread
from mbf_abstract.maps.avoided_places import AvoidedPlace
from mbf_abstract.maps.relaxation import Relaxation
from mbf_abstract.plugins import ControlResult, PluginKind
from mbf_abstract.time.clock import Clock
from mbf_abstract.traffic.traffic import Traffic


class MapHooks(Protocol):
    """What a server of a map may add to every execution."""

    @property
    def ground_is_level(self) -> bool:
        """Whether all ground is at one height, so that heights of poses mean nothing."""

    def map_problem(self) -> str:
        """Why the map must not be driven on right now (e.g. a silent sensor); empty = it is current."""

    def missing_floor(self) -> str:
        """Which floor has not come yet, or cannot be placed, so that nothing can be planned; empty if all are there."""

    def floors_taken(self) -> int:
        """How many floors the map has taken up at run time; a plan of before is one on another floor."""

    def awaits_scan(self) -> bool:
        """Whether a plan should wait for the next scan, as its map was cleared; scans that have come are taken in."""

    def path_problem(self, path: Path) -> str:
        """Why the path of a planner, in the global frame, leads off the map; empty if it does not, or nobody knows."""

    def obstacle_along(self, path: Path) -> str:
        """Where the robot would touch something on a path in the global frame; empty if nowhere, or nobody knows."""

    def avoid_contact(self, pose: Pose, velocity: Twist, answer: ControlResult) -> ControlResult:
        """The answer of a controller with a command by which the robot touches nothing that moves."""

    def within_speed_limit(self, pose: Pose, answer: ControlResult, full_speed: float) -> ControlResult:
        """The answer of a controller with a command within the speed limits of the map's layers."""

    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """What the robot would touch if it kept a command for a time [s], and where; empty = nothing."""

    def avoid(self, places: Sequence[AvoidedPlace]) -> None:
        """Close these places on all maps, and open those that were closed before."""

    def forget(self, places: Sequence[tuple[Pose, float]]) -> None:
        """Free squares around places, of a side [m] each, on the map of plans, until sensors see what stands there."""

    def using_map(self, kind: PluginKind) -> AbstractContextManager[None]:
        """Keep the map alive while a goal of this kind runs."""


@dataclass
class Runtime:
    """One server's shared parts; ``parameters`` is replaced as a whole when parameters change at run time."""

    clock: Clock
    events: EventBus
    supervisor: Supervisor
    callbacks: CallbackThread
    gate: VelocityGate
    robot: RobotInformation
    transforms: TransformBuffer
    parameters: NavigationParameters
    map_hooks: MapHooks
    relaxation: Relaxation = field(default_factory=Relaxation)
    """Slack that recoveries grant for a while."""
    traffic: Traffic = field(default_factory=Traffic)
    """What robots with this navigation announce to each other."""
    goal_ids: Iterator[int] = field(default_factory=lambda: count(1))
    """Goal ids, unique in this server."""
    hanging: set[object] = field(default_factory=set)
    """What runs on although its goal has ended: a call that does not come back; capped by ``max_quarantined``."""

    def as_safe(self, pose: Pose, velocity: Twist, answer: ControlResult, controller: Any = None) -> ControlResult:
        """An answer of a controller, within the speed limits of the map, by which the robot touches nothing that moves.

        Limits in percent are shares of the controller's ``full_speed``, or its ``max_vel_x``, within the robot's.
        """
        full = getattr(controller, "full_speed", math.inf)
        full = min(full, getattr(getattr(controller, "parameters", None), "max_vel_x", math.inf))
        within = self.map_hooks.within_speed_limit(pose, answer, min(full, self.gate.limits.max_vel_x))
        return self.map_hooks.avoid_contact(pose, velocity, within)

    def velocity_or_command(self, measured: Twist | None) -> Twist:
        """How the robot moves: as measured, and without odometry as last commanded, straight on for a car."""
        if measured is not None:
            return measured
        command = self.gate.last_command
        return Twist.planar(command.speed) if isinstance(command, AckermannCommand) else command
