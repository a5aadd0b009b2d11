"""The plugin interfaces: planner, controller, recovery, refiner, and the results they return.

Who calls what, from which thread:

- A plugin is constructed once, by the server, with a *context* (its name, its validated parameters, clock, random
  generator, robot information, and the map of the derived server).
- Its main method (``make_plan``, ``compute_velocity_commands``, ``run_behavior``, ``apply_refinement``) runs on a
  worker thread of a slot. It may take time; it must poll the cancel token at least every 50 ms of work. The same
  instance never runs twice at once.
- ``cancel`` is called from other threads, any number of times, also when nothing runs. It must only set a flag.

Failure of navigation is a value: return a result with an outcome of the action's range and a message. An exception
that leaves a plugin ends the goal with INTERNAL_ERROR and stops the robot.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, ClassVar, Protocol

from mbf_abstract.geometry import Command, FloatArray, Path, Pose, Twist
from mbf_abstract.maps.relaxation import Relaxation
from mbf_abstract.outcomes import PERMANENT_OUTCOMES, is_success
from mbf_abstract.parameters import PluginParameters
from mbf_abstract.time.cancel import CancelToken
from mbf_abstract.traffic.traffic import Traffic

if TYPE_CHECKING:
    import numpy as np

    from mbf_abstract.drive.robot import RobotInformation
    from mbf_abstract.time.clock import Clock


class PluginKind(Enum):
    """The four kinds of plugins a server loads; the value is the last part of the entry-point group's name."""

    PLANNER = "planners"
    CONTROLLER = "controllers"
    RECOVERY = "recoveries"
    REFINER = "refiners"


@dataclass(frozen=True)
class PluginContext:
    """What every plugin is constructed with; a map's server derives it and adds its map.

    Attributes
    ----------
    name : str
        Name of the instance in the configuration.
    parameters : PluginParameters
        Validated instance of the plugin class's ``Parameters``.
    clock : Clock
        The only source of time.
    rng : numpy.random.Generator
        The plugin's own generator, seeded by the server from its seed and the plugin's name.
    robot : RobotInformation
        Fresh robot pose and velocity.
    relaxation : Relaxation
        Slack that recoveries of this server grant for a while. Planning and arrival take it into account by themselves;
        a controller may widen limits of its own.
    min_turning_radius : float
        Radius [m] of the robot's tightest curve when the plugin is loaded; 0 = it turns on the spot.
    may_reverse : bool
        Whether the server lets the robot drive backward, by its ``min_vel_x``.
    traffic : Traffic
        What other robots with this navigation announce; empty unless the server is connected to some.
    """

    name: str
    parameters: PluginParameters
    clock: Clock
    rng: np.random.Generator
    robot: RobotInformation
    relaxation: Relaxation = field(default_factory=Relaxation, kw_only=True)
    min_turning_radius: float = field(default=0.0, kw_only=True)
    may_reverse: bool = field(default=True, kw_only=True)
    traffic: Traffic = field(default_factory=Traffic, kw_only=True)


@dataclass(frozen=True)
class InnerPlugin:
    """A plugin that another one constructs and calls, as its parameters name it.

    Attributes
    ----------
    type_key, block_key : str
        Parameters of the outer plugin that hold the type and the parameter block of the inner one.
    """

    kind: PluginKind
    type_key: str
    block_key: str


class Plugin(ABC):
    """Common base of the four interfaces."""

    Parameters: ClassVar[type[PluginParameters]] = PluginParameters
    parameters: PluginParameters
    inner_plugins: ClassVar[tuple[InnerPlugin, ...]] = ()
    """What a configuration is checked for beside ``Parameters``: types that load, and legal blocks for them."""
    modelled_compute_time: float = 0.0
    """Seconds of virtual time one call of the main method is made to take on a SimClock."""

    def __init__(self, context: PluginContext) -> None:
        self.name = context.name
        self.parameters = context.parameters
        self.clock = context.clock
        self.rng = context.rng
        self.robot = context.robot
        self.relaxation = context.relaxation
        self.min_turning_radius = context.min_turning_radius
        self.may_reverse = context.may_reverse
        self.traffic = context.traffic

    def cancel(self) -> bool:
        """Ask the running call to end; return whether the plugin supports this beside its cancel token."""
        return False

    def parameters_changed(self) -> None:  # noqa: B027 - an optional hook
        """React to new ``self.parameters``, set at run time; called while no main method runs."""


@dataclass(frozen=True)
class PluginResult:
    """What the answers of all plugins have: an outcome code, and a text that may be empty."""

    outcome: int
    message: str = ""

    @property
    def success(self) -> bool:
        """Whether the outcome is below 10."""
        return is_success(self.outcome)


# ---------------------------------------------------------------------------------------------------- planner
@dataclass(frozen=True)
class PlanRequest:
    """One question to a planner. All poses are in the server's global frame.

    Attributes
    ----------
    dist_tolerance : float
        How far [m] from the goal a path may end if the goal itself cannot be reached; 0 = exactly there.
    angle_tolerance : float
        The same for the final heading [rad].
    via : tuple of Pose
        Poses to pass between start and goal, in order.
    """

    start: Pose
    goal: Pose
    dist_tolerance: float = 0.0
    angle_tolerance: float = 0.0
    via: tuple[Pose, ...] = ()
    cancel_token: CancelToken = field(default_factory=CancelToken)


@dataclass(frozen=True)
class PlanResult(PluginResult):
    """Answer of a planner: an outcome of ``GetPathOutcome`` (or a plugin's own), a text, the path and its cost.

    A cost of exactly 0 is replaced by the path's length. ``permanent`` marks a failure that planning again from the
    same start cannot change, whatever the sensors see: the goal ends at once, without retries and, but for
    BLOCKED_START, recoveries. It is set for OUT_OF_MAP, INVALID_START and INVALID_GOAL.
    """

    path: Path | None = None
    cost: float = 0.0
    permanent: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "permanent", self.permanent or self.outcome in PERMANENT_OUTCOMES)


class AbstractPlanner(Plugin):
    """Finds a path from a start to a goal pose."""

    @property
    def avoided_share(self) -> float:
        """From which share of an obstacle's cost on ground is an obstacle for it; 1 = obstacles alone are."""
        return 1.0

    @abstractmethod
    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Find a path; must poll ``request.cancel_token`` and return CANCELED (51) soon after it is set."""


# ------------------------------------------------------------------------------------------------- controller
@dataclass(frozen=True)
class ControlRequest:
    """One control cycle: the robot's pose in the global frame and its velocity in the base frame."""

    pose: Pose
    velocity: Twist
    cancel_token: CancelToken = field(default_factory=CancelToken)


@dataclass(frozen=True)
class ControlResult(PluginResult):
    """Answer of a controller: an outcome of ``ExePathOutcome`` (or a plugin's own), a text and the command.

    The command is sent only if the outcome is a success; ``None`` then counts as NO_VALID_CMD. ``hindered_by`` is a
    text on the moving object without which the robot would drive on: as long as its command hardly moves it, it waits
    for that object, and the path counts as blocked after the ``max_wait`` of the map's layer.
    """

    command: Command | None = None
    hindered_by: str = ""


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """What a controller means to do beyond its present command.

    Attributes
    ----------
    velocities : (n, 3) float
        vx [m/s], vy [m/s], wz [rad/s] in the base frame, one step after the other.
    step_time : float
        How long each of them lasts [s].
    """

    velocities: FloatArray
    step_time: float


class AbstractController(Plugin):
    """Follows a path: one velocity command a cycle."""

    @property
    def turns_on_the_spot(self) -> bool:
        """Whether it needs a robot that can turn on the spot; a server whose robot cannot reports it."""
        return False

    refusal: str = ""
    """Why ``set_plan`` has refused the last path, see ``refuse``; empty = not said."""

    @abstractmethod
    def set_plan(self, path: Path) -> bool:
        """Take over a path in the global frame; False = refused (INVALID_PATH). Also called while driving."""

    def refuse(self, reason: str) -> bool:
        """Return False, and let the goal's message say why: ``return self.refuse("the path is in reverse")``."""
        self.refusal = reason
        return False

    def hand_on(self, inner: AbstractController, path: Path) -> bool:
        """``set_plan`` of a controller inside this one, for this one's own: what it refuses, this one refuses."""
        inner.refusal = ""
        return inner.set_plan(path) or self.refuse(inner.refusal)

    @abstractmethod
    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Compute the command of this cycle; one call should take less than a control period."""

    @abstractmethod
    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether ``pose`` is at the end of the plan within the tolerances [m, rad]."""

    def cancel(self) -> bool:
        """Return True to slow down by yourself and answer CANCELED (101) when stopped; False = stop me now."""
        return False

    def planned_motion(self) -> PlannedMotion | None:
        """Return the motion planned after the present command, for viewers; None if there is none."""
        return None


# --------------------------------------------------------------------------------------------------- recovery
class Motion(Protocol):
    """How a recovery moves the robot: through the velocity gate, with fresh state, and cancelable."""

    def pose(self) -> Pose:
        """Fresh robot pose in the global frame; raises RobotStateError."""

    def velocity(self) -> Twist:
        """Measured velocity in the base frame; raises RobotStateError."""

    def send(self, command: Command) -> bool:
        """Send one command; False when the gate refused it (lease lost, paused).

        It holds for ``command_timeout``: the watchdog then stops a robot that has got no other one, also where the
        driver is still busy with it.
        """

    def sleep(self, seconds: float) -> bool:
        """Wait for so many seconds; False as soon as the behaviour is to end."""


@dataclass(frozen=True)
class RecoveryRequest:
    """One run of a recovery behaviour."""

    motion: Motion
    cancel_token: CancelToken = field(default_factory=CancelToken)


@dataclass(frozen=True)
class RecoveryResult(PluginResult):
    """Answer of a recovery: an outcome of ``RecoveryOutcome`` (or a plugin's own) and a text."""


class AbstractRecovery(Plugin):
    """Gets the robot out of trouble: clears a map, backs up, turns, waits."""

    @abstractmethod
    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Run the behaviour to its end; must poll the cancel token (or use ``motion.sleep``) and stop the robot."""


# ---------------------------------------------------------------------------------------------------- refiner
@dataclass(frozen=True)
class RefineResult(PluginResult):
    """Answer of a refiner: outcome of ``RefinePathOutcome``, text, and the refined path.

    Without success a client gets the path it gave, whatever stands here.
    """

    path: Path | None = None


class AbstractRefiner(Plugin):
    """Improves a path between planning and following, e.g. smooths it."""

    @abstractmethod
    def apply_refinement(self, path: Path, cancel_token: CancelToken) -> RefineResult:
        """Return a better path from the same start to the same goal; never modify the given one."""


PLUGIN_BASES: dict[PluginKind, type[Plugin]] = {
    PluginKind.PLANNER: AbstractPlanner,
    PluginKind.CONTROLLER: AbstractController,
    PluginKind.RECOVERY: AbstractRecovery,
    PluginKind.REFINER: AbstractRefiner,
}
