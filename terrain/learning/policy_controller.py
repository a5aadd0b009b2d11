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

from mbf_abstract.drive.velocity_limits import VelocityLimits
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.map_plugin import MapContext, MapPlugin
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
    sources: tuple[str, ...] = parameter(
        (), "Sensors that are observed, each of which must send scans; empty = all that have sent any.", dynamic=False
    )
    check_ahead_time: float = parameter(
        0.5,
        "The robot stops where the command would touch something so soon on the map; 0 = never.",
        unit="s",
        ge=0.0,
        le=10.0,
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
        sources = self.parameters.sources
        self._observer = Observer(self.observation, self.navigation_map, self.transforms, self.scans, sources)
        self._curves = VelocityLimits(min_turning_radius=self.min_turning_radius)

    @abstractmethod
    def act(self, observation: Observation) -> ArrayLike:
        """Return the action, numbers from -1 to 1, for an observation as the environment gives it."""

    @property
    def turns_on_the_spot(self) -> bool:
        """True unless the robot cannot: commands keep to its tightest curve."""
        return self.min_turning_radius == 0.0

    def set_plan(self, path: Path) -> bool:
        """Take over a path that has poses, in a frame with a transform to the map's."""
        if len(path) == 0 or not self.transforms.can_transform(self.navigation_map.frame_id, path.frame_id):
            return False
        self._observer.set_plan(path)
        return True

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Observe, ask the policy, and check on the map what the robot would drive.

        The age of scans is judged last, so that a call without scans has loaded and compiled all that a drive needs.
        """
        limits = self.parameters
        problem = self._observer.scan_problem(self.clock.now(), limits.max_scan_age) if limits.max_scan_age else ""
        obstacle = ""
        try:
            observation = self._observer.observe(request.pose, request.velocity)
            command = self._curves.apply(self.commands.command(self.act(observation)))
            assert isinstance(command, Twist)
            if limits.check_ahead_time:
                there = self.on_map(request.pose)
                obstacle = self.navigation_map.obstacle_ahead(there, command, limits.check_ahead_time)
        except TransformError as error:
            return ControlResult(
                ExePathOutcome.NO_VALID_CMD if problem else ExePathOutcome.TF_ERROR, problem or str(error)
            )
        if problem:
            return ControlResult(ExePathOutcome.NO_VALID_CMD, problem)
        if obstacle:
            return ControlResult(ExePathOutcome.BLOCKED_PATH, obstacle)
        return ControlResult(ExePathOutcome.SUCCESS, "", command)

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether the path has been driven to its end, and the pose is within both tolerances of it."""
        has_plan = self._observer.tracker is not None
        return has_plan and self._observer.has_arrived(pose, dist_tolerance, angle_tolerance)
