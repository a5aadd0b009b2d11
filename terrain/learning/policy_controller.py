"""A learned policy as a controller of the navigation, on every map that its observation can be had from.

When to use: to judge a policy beside the shipped controllers (``mbf run --controller``, ``mbf bench --controller``),
and to drive with it. When not: as the only safeguard of a real robot; the policy decides alone but for the check of the
motion ahead on the map. Derive the class in a module of your own, with the observation and the actions that the policy
was trained with:

>>> class MyPolicy(PolicyController):
...     observation = ObservationParameters(scan_sectors=0)
...     commands = CommandRange(max_vel_x=0.5, max_vel_theta=1.5)
...
...     def act(self, observation):
...         return [1.0, observation["waypoints"][1, 1]]
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

from numpy.typing import ArrayLike

from mbf_abstract.geometry import Path, Pose, normalize_angle
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.navigation_map import MapContext, MapPlugin
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import AbstractController, ControlRequest, ControlResult
from terrain.learning.command_range import CommandRange
from terrain.learning.observation import Observation, ObservationParameters, Observer


class PolicyParameters(PluginParameters):
    """Parameters of every ``PolicyController``; derive it for more."""

    max_scan_age: float = parameter(
        0.5, "The robot stops where the newest scan of a sensor is older; 0 = never.", unit="s", ge=0.0, le=60.0
    )
    check_ahead_time: float = parameter(
        0.5, "The robot stops where the command would touch something so soon on the map; 0 = never.", unit="s", ge=0.0
    )


class PolicyController(MapPlugin, AbstractController):
    """Asks a policy for every command.

    Attributes
    ----------
    observation : ObservationParameters
        What the policy was trained with.
    commands : CommandRange
        Likewise.

    Raises
    ------
    ValueError
        The map cannot give the observation.
    """

    Parameters: ClassVar[type[PluginParameters]] = PolicyParameters
    parameters: PolicyParameters
    observation: ClassVar[ObservationParameters] = ObservationParameters()
    commands: ClassVar[CommandRange] = CommandRange()

    def __init__(self, context: MapContext[Any]) -> None:
        super().__init__(context)
        self._observer = Observer(self.observation, self.navigation_map, self.transforms, self.scans)

    @abstractmethod
    def act(self, observation: Observation) -> ArrayLike:
        """Return the action, numbers from -1 to 1, for an observation as the environment gives it."""

    @property
    def turns_on_the_spot(self) -> bool:
        """True: nothing keeps a policy from doing so."""
        return True

    def set_plan(self, path: Path) -> bool:
        """Take over a path that has poses."""
        if len(path) == 0:
            return False
        self._observer.set_plan(path)
        return True

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Observe, ask the policy, and check the command on the map."""
        limits, age = self.parameters, self._observer.scan_age(self.clock.now())
        if limits.max_scan_age and age > limits.max_scan_age:
            return ControlResult(ExePathOutcome.NO_VALID_CMD, f"the newest scan is {age:.2f} s old")
        try:
            observation = self._observer.observe(request.pose, request.velocity)
            command = self.commands.command(self.act(observation))
            there = self.on_map(request.pose)
        except TransformError as error:
            return ControlResult(ExePathOutcome.TF_ERROR, str(error))
        if limits.check_ahead_time:
            obstacle = self.navigation_map.obstacle_ahead(there, command, limits.check_ahead_time)
            if obstacle:
                return ControlResult(ExePathOutcome.BLOCKED_PATH, obstacle)
        return ControlResult(ExePathOutcome.SUCCESS, "", command)

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether the pose is within both tolerances of the end of the path."""
        goal = None if self._observer.tracker is None else self._observer.tracker.goal
        if goal is None or pose.distance_to(goal) > dist_tolerance:
            return False
        return abs(normalize_angle(goal.yaw - pose.yaw)) <= angle_tolerance
