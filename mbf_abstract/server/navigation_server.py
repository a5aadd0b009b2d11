"""The abstract navigation server: owns the runtime, the plugins and the six actions. It knows no map.

A server of a map overrides hooks only (``server.map_interface``): make the map, make a plugin's context, decide
whether it may be driven on, keep it alive while goals run, answer map queries. See ``mbf_costmap_nav.server``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

from mbf_abstract.actions.exe_path import ExePathAction
from mbf_abstract.actions.follow_waypoints import FollowWaypointsAction
from mbf_abstract.actions.get_path import GetPathAction
from mbf_abstract.actions.move_base import MoveBaseAction
from mbf_abstract.actions.recovery import RecoveryAction
from mbf_abstract.actions.refine_path import RefinePathAction
from mbf_abstract.config.configuration import Config
from mbf_abstract.config.navigation_parameters import READ_ONCE, NavigationParameters
from mbf_abstract.drive.driver_check import check_driver
from mbf_abstract.drive.robot import Robot, RobotInformation, turning_radius_of
from mbf_abstract.drive.velocity_gate import VelocityGate
from mbf_abstract.drive.velocity_limits import VelocityLimits
from mbf_abstract.event_bus import EventBus
from mbf_abstract.events import EventKind
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.execution.supervisor import Supervisor
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.callbacks import CallbackThread
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.parameters import with_changes
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.map_interface import MapInterface
from mbf_abstract.server.plugin_notes import MapNotes, notes_on_numbers, notes_on_plugins
from mbf_abstract.server.process_end import ProcessEndWatch
from mbf_abstract.server.warm_up import try_controller, try_planner
from mbf_abstract.time.clock import Clock
from mbf_abstract.time.sim_clock import SimClock


class AbstractNavigationServer(MapInterface):
    """Actions, plugins and the velocity gate of one robot; use it as a context manager or call ``close``.

    Parameters
    ----------
    config : Config
        A validated configuration.
    robot : Robot
        The robot's driver; DriverError if it is none.
    clock : Clock
        ``WallClock`` for a real robot, ``SimClock`` for simulated time.
    transforms : TransformBuffer, optional
        Where the robot's pose is published.
    events : EventBus, optional
        Where events go.
    seed : int
        Seed of the plugins' random generators.

    Attributes
    ----------
    scan_listeners : list of callables
        Called with every scan that comes, on its driver's thread, before the map takes it: must be short.
    """

    def __init__(
        self,
        config: Config,
        robot: Robot,
        clock: Clock,
        transforms: TransformBuffer | None = None,
        events: EventBus | None = None,
        seed: int = 0,
    ) -> None:
        self.config = config
        self._closed = False
        self.scan_listeners: list[Callable[[RangeScan], None]] = []
        check_driver(robot, clock)
        self._own_turning_radius = turning_radius_of(robot)
        super().__init__(self._make_runtime(config.parameters, robot, clock, transforms, events), seed)
        self._process_end, self.map_notes = ProcessEndWatch(self.runtime.gate), MapNotes(self.runtime.events)
        try:
            self.load_map(config)
            for spec in config.plugins:
                self.load_plugin(spec)
        except BaseException:
            self.close()
            raise
        self.get_path = GetPathAction(self.runtime, self.plugins)
        self.exe_path = ExePathAction(self.runtime, self.plugins)
        self.recovery = RecoveryAction(self.runtime, self.plugins)
        self.refine_path = RefinePathAction(self.runtime, self.plugins)
        self.move_base = MoveBaseAction(
            self.runtime, self.plugins, self.get_path, self.exe_path, self.recovery, self.refine_path
        )
        self.follow_waypoints = FollowWaypointsAction(self.runtime, self.move_base)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user: what was left out of the configuration, and what the map server found."""
        left_out = (
            f"left out: optional {skipped.kind.name.lower()} {skipped.name!r}: {skipped.reason}"
            for skipped in self.config.skipped
        )
        numbers = notes_on_numbers(self.config, self.plugins, self.runtime)
        of_plugins = notes_on_plugins(self.plugins, self.runtime, self.car_controllers)
        return (*left_out, *self.map_notes, *numbers, *of_plugins)

    # --------------------------------------------------------------------------------------- parameters
    def set_parameters(self, **changes: Any) -> None:
        """Change the server's parameters at run time, all or none.

        Raises
        ------
        ParameterError
            A value is not legal, or a parameter is read once, at the start. A ValueError.
        """
        base = self.config.parameters if changes.pop("restore_defaults", False) else self.runtime.parameters
        self.runtime.parameters = with_changes(base, changes, READ_ONCE)
        self._put_into_effect(self.runtime.parameters)
        self.runtime.events.emit(EventKind.PARAMETER_CHANGED, "server", **changes)

    def _put_into_effect(self, parameters: NavigationParameters) -> None:
        """Hand parameters to those parts that keep a copy."""
        runtime = self.runtime
        runtime.gate.limits = _limits(parameters, self._own_turning_radius)
        runtime.gate.command_timeout = parameters.command_timeout
        runtime.robot.max_pose_age = runtime.robot.max_velocity_age = parameters.tf_timeout
        if isinstance(runtime.clock, SimClock):
            runtime.clock.hang_guard = parameters.hang_guard

    def warm_up(
        self, start: Pose, goal: Pose, on_step: Callable[[str], None] = lambda text: None, only_defaults: bool = False
    ) -> None:
        """Call every planner and controller once, without moving, so that their kernels are compiled before a goal.

        One that misbehaves is passed over: it is recorded as a fault, or quarantined while it hangs.

        Parameters
        ----------
        start, goal : Pose
            In the global frame; a plan between them is made with every planner.
        on_step : callable
            Called with a text before each plugin's turn: its name, and which of how many it is.
        only_defaults : bool
            Call the first planner and the first controller only, where no real time passes while others are compiled.
        """
        path = Path.from_poses([start, goal])
        planners, controllers = self.plugins.all_of(PluginKind.PLANNER), self.plugins.all_of(PluginKind.CONTROLLER)
        if only_defaults:
            planners, controllers = planners[:1], controllers[:1]
        count = len(planners) + len(controllers)
        for number, planner in enumerate(planners, start=1):
            on_step(f"warming up planner {planner.name} ({number} of {count})")
            path = try_planner(self.runtime, planner, start, goal) or path
        for number, controller in enumerate(controllers, start=len(planners) + 1):
            on_step(f"warming up controller {controller.name} ({number} of {count})")
            try_controller(self.runtime, controller, path, start)

    # --------------------------------------------------------------------------------------- life cycle
    def cancel_all(self, reason: str = "all goals canceled") -> None:
        """Cancel every running goal; never waits."""
        for action in self.actions:
            action.cancel_all(reason)

    def pause_all(self) -> None:
        """Pause every running goal: the robot stands, all goals are kept; idempotent, never waits."""
        for action in self.actions:
            for handle in action.unfinished:
                handle.pause()

    def resume_all(self) -> None:
        """Let every paused goal go on."""
        for action in self.actions:
            for handle in action.unfinished:
                handle.resume()

    def close(self) -> None:
        """Stop the robot for good, cancel everything, end the threads; idempotent, never waits for a plugin."""
        if self._closed:
            return
        self._closed = True
        try:
            self.runtime.gate.close()
        finally:  # also after a Ctrl-C that came just then
            self._process_end.end()
            for action in self.actions:
                action.close()
            self.runtime.callbacks.close()
            self.runtime.supervisor.close()
            self.close_map()
        self.runtime.clock.settle()  # or the threads would stay where the clock is not used any more

    def __enter__(self) -> AbstractNavigationServer:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    @property
    def actions(self) -> list[Any]:
        """The actions, the ones that send goals to others first; those made so far while the server is being built."""
        names = ("follow_waypoints", "move_base", "get_path", "exe_path", "recovery", "refine_path")
        return [getattr(self, name) for name in names if hasattr(self, name)]

    def _make_runtime(
        self,
        parameters: NavigationParameters,
        robot: Robot,
        clock: Clock,
        transforms: TransformBuffer | None,
        events: EventBus | None,
    ) -> Runtime:
        transforms = transforms or TransformBuffer(parameters.tf_cache_time)
        transforms.follow_clock(clock.now)
        events = events or EventBus(clock.now)
        supervisor = Supervisor(clock, events)
        runtime = Runtime(
            clock=clock,
            events=events,
            supervisor=supervisor,
            callbacks=CallbackThread(clock, events, supervisor),
            gate=VelocityGate(
                robot, clock, events, _limits(parameters, self._own_turning_radius), parameters.command_timeout
            ),
            robot=RobotInformation(
                robot,
                transforms,
                clock,
                parameters.global_frame,
                parameters.robot_frame,
                max_pose_age=parameters.tf_timeout,
                max_velocity_age=parameters.tf_timeout,
                uses_odometry=parameters.use_odometry,
            ),
            transforms=transforms,
            parameters=parameters,
            map_hooks=self,
        )
        if isinstance(clock, SimClock):
            clock.hang_guard = parameters.hang_guard
        return runtime


def _limits(parameters: NavigationParameters, own_turning_radius: float) -> VelocityLimits:
    """Limits of the parameters; where they do not give a turning radius [m], the robot's own."""
    given = {limit.name: getattr(parameters, limit.name) for limit in fields(VelocityLimits)}
    limits = {name: value for name, value in given.items() if value is not None}
    return VelocityLimits(**{"min_turning_radius": own_turning_radius, **limits})
