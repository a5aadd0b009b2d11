"""The parameters every server has, with Move Base Flex's names, defaults and meanings, and a few of our own.

A parameter marked ``dynamic`` also takes effect on goals that are running; the others are read when a goal starts, and
those in ``READ_ONCE`` when the server is made.
"""

from __future__ import annotations

import math
from typing import Literal

from pydantic import model_validator

from mbf_abstract.parameters import ParameterModel, parameter

READ_ONCE = ("global_frame", "robot_frame", "use_odometry", "tf_cache_time")
"""What a running server cannot change; the attempt is an error."""


class NavigationParameters(ParameterModel):
    """Top-level keys of a configuration."""

    # Planning
    planner_frequency: float = parameter(
        0.0, "How often move_base plans anew while driving; 0 = never.", unit="Hz", ge=0.0, le=100.0
    )
    planner_patience: float = parameter(
        5.0, "Time for one get_path goal with all its retries; 0 = no limit.", unit="s", ge=0.0, le=100.0
    )
    planner_max_retries: int = parameter(
        -1, "Further planner calls after a failure; 0 = none, -1 = unlimited.", ge=-1, le=1000
    )
    planner_retry_delay: float = parameter(
        0.01, "Pause between two calls of a failing planner or refiner.", unit="s", gt=0.0, le=10.0
    )
    fallback_planner: str = parameter(
        "",
        "Planner that plans where the one of the goal finds no path from or to a place on the map; empty = none. Each "
        "has planner_patience to itself; after such a failure only this one is called again.",
    )
    plan_end_tolerance: float = parameter(
        0.5,
        "How far a plan's ends may lie from start and goal, beside the goal's tolerance; where a path ends farther off "
        "than that tolerance, the message of its success names the distance.",
        unit="m",
        ge=0.0,
        le=1000.0,
    )
    refiner_max_retries: int = parameter(
        0, "Further refiner calls after a failure; 0 = none, -1 = unlimited.", ge=-1, le=1000
    )
    plan_refiner: str = parameter(
        "", "Refiner that move_base, and a run's reference trees, send every plan through; empty = none."
    )
    replan_failed_policy: Literal["keep", "stop", "recover"] = parameter(
        "keep", "What move_base does if planning while driving fails: keep the old path, stop, or start recovery."
    )

    # Control
    controller_frequency: float = parameter(20.0, "Rate of the control loop.", unit="Hz", gt=0.0, le=100.0)
    controller_patience: float = parameter(
        5.0, "Time without a valid command, or in one controller call; 0 = no limit.", unit="s", ge=0.0, le=100.0
    )
    controller_max_retries: int = parameter(
        -1, "Failing cycles in a row that are tolerated; 0 = none, -1 = unlimited.", ge=-1, le=1000
    )
    force_stop_at_goal: bool = parameter(
        True, "Stop on arrival, and succeed once the robot stands; upstream's default is false.", dynamic=False
    )
    force_stop_on_cancel: bool = parameter(
        True, "Send zero velocity on a forced cancel; upstream's default is false.", dynamic=False
    )
    force_stop_on_retry: bool = parameter(
        True, "Send zero velocity on a failed cycle; otherwise the controller's own command.", dynamic=False
    )
    mbf_tolerance_check: bool = parameter(
        False, "Whether arrival is also decided by the tolerances, not by the controller alone.", dynamic=False
    )
    mbf_tolerance_exclusive: bool = parameter(
        False, "Whether arrival is decided by the tolerances alone; the controller is not asked.", dynamic=False
    )
    dist_tolerance: float = parameter(
        0.1,
        "Distance to the goal that counts as arrived, where a goal gives none.",
        unit="m",
        ge=0.0,
        le=1000.0,
        dynamic=False,
    )
    angle_tolerance: float = parameter(
        math.pi / 18.0, "The same for the heading.", unit="rad", ge=0.0, le=math.pi, dynamic=False
    )
    goal_max_speed: float = parameter(
        0.05, "With force_stop_at_goal: speed below which the robot stands.", unit="m/s", gt=0.0, dynamic=False
    )
    cmd_vel_ignored_tolerance: float = parameter(
        5.0, "Time a robot may ignore commands before it counts as stuck; <= 0 = for ever.", unit="s", dynamic=False
    )

    # Recovery and oscillation
    recovery_enabled: bool = parameter(True, "Whether move_base tries recovery behaviours.")
    recovery_patience: float = parameter(
        15.0, "Longest run of a recovery behaviour; 0 = no limit.", unit="s", ge=0.0, le=1000.0
    )
    max_tilt: float | None = parameter(
        None,
        "Tilt of the robot's pose at which a path is given up, before the robot tips over; absent = none.",
        unit="rad",
        gt=0.0,
        le=math.pi / 2.0,
    )
    oscillation_timeout: float = parameter(
        0.0, "Time without progress that counts as oscillation; 0 = never.", unit="s", ge=0.0, le=60.0
    )
    oscillation_distance: float = parameter(0.5, "Moving this far is progress.", unit="m", ge=0.0, le=10.0)
    progress_timeout: float = parameter(
        60.0,
        "Time in which a robot must come 0.1 m farther along its path, or turn 0.1 rad to its goal; 0 = never.",
        unit="s",
        ge=0.0,
        le=3600.0,
    )
    oscillation_angle: float = parameter(3.14, "Turning this far is progress.", unit="rad", ge=0.0, le=6.28)

    # Robots that are stuck
    stuck_failures: int = parameter(
        3,
        "Failures of one kind at one place, for one goal, that count as stuck, and setbacks there that are a failure; "
        "0 = never.",
        ge=0,
        le=1000,
    )
    stuck_time: float = parameter(
        10.0, "And that come at least this long after the first of them.", unit="s", ge=0.0, le=3600.0
    )
    stuck_distance: float = parameter(0.5, "Failures this near to each other are at one place.", unit="m", ge=0.0)
    escalation_behaviors: tuple[str, ...] = parameter(
        (),
        "Recovery behaviours for a robot that is stuck, each once at a place, in this order; then move_base and the "
        "navigation tree give up. They are not among those that move_base runs by default. Empty = no escalation, as "
        "in Move Base Flex.",
    )
    right_of_way_behavior: str | None = parameter(
        None,
        "Recovery behaviour of a robot that is blocked where it meets robots that announce their paths, before any "
        "other. It is then not among those that move_base runs by default. Empty = none; absent = the one named "
        "give_way, of a robot that has loaded it and announces its own path.",
    )
    right_of_way_distance: float | None = parameter(
        None,
        "Two robots meet where their paths come nearer to each other than this; absent = the distance of the "
        "behaviour, or 0.8 m where it has none.",
        unit="m",
        gt=0.0,
        le=5.0,
    )
    idle_makes_room: bool = parameter(
        True,
        "Whether a robot without a goal, which has loaded the behaviour for the right of way and announces itself, "
        "pulls out for a robot that is blocked by it and asks, and drives back afterwards.",
    )

    # Robot, frames and odometry
    global_frame: str = parameter("map", "Frame of goals and paths.", dynamic=False)
    robot_frame: str = parameter("base_link", "Frame of the robot.", dynamic=False)
    tf_timeout: float = parameter(
        3.0, "Longest wait for a transform, and greatest age of the robot pose.", unit="s", gt=0.0, dynamic=False
    )
    tf_cache_time: float = parameter(10.0, "History kept of each frame.", unit="s", gt=0.0, le=3600.0, dynamic=False)
    use_odometry: bool = parameter(
        True, "Whether the robot's velocity comes from its odometry; otherwise it counts as standing.", dynamic=False
    )

    # Safety: the velocity gate and the limits of what a fault may cost
    command_timeout: float = parameter(
        0.5, "Time after the last command at which the robot is stopped.", unit="s", gt=0.0, le=10.0
    )
    command_delay: float = parameter(
        0.0,
        "Time until a command shows in how the robot moves; controllers are given the pose and velocity of then.",
        unit="s",
        ge=0.0,
        le=1.0,
    )
    cancel_grace: float = parameter(
        1.0, "Time a plugin has to obey a cancel before it is quarantined.", unit="s", ge=0.0, le=60.0
    )
    hang_guard: float = parameter(
        30.0,
        "Real time that a plugin call may take while simulated time stands, until it counts as hung; on Linux without "
        "the time in which the machine had no processor for it.",
        unit="s",
        gt=0.0,
    )
    max_quarantined: int = parameter(
        8, "Hung plugin threads that are tolerated before goals are rejected.", ge=1, le=1000
    )
    max_vel_x: float | None = parameter(None, "Forward limit of commands; absent = none.", unit="m/s", ge=0.0)
    min_vel_x: float | None = parameter(None, "Reverse limit of commands, negative or 0.", unit="m/s", le=0.0)
    max_vel_y: float | None = parameter(None, "Sideways limit of commands.", unit="m/s", ge=0.0)
    max_vel_z: float | None = parameter(None, "Limit of commands upwards and downwards.", unit="m/s", ge=0.0)
    max_vel_roll: float | None = parameter(None, "Roll rate limit of commands.", unit="rad/s", ge=0.0)
    max_vel_pitch: float | None = parameter(None, "Pitch rate limit of commands.", unit="rad/s", ge=0.0)
    max_vel_theta: float | None = parameter(None, "Yaw rate limit of commands.", unit="rad/s", ge=0.0)
    max_steering_angle: float | None = parameter(
        None, "Limit of a car's steering angle.", unit="rad", gt=0.0, le=math.pi / 2.0
    )
    min_turning_radius: float | None = parameter(
        None,
        "Radius of the tightest curve of commands; 0 = turning on the spot is allowed, absent = the driver's.",
        unit="m",
        ge=0.0,
        le=100.0,
    )

    # Life of the maps
    shutdown_costmaps: bool = parameter(False, "Whether maps, of any kind, stop updating while no goal runs.")
    shutdown_costmaps_delay: float = parameter(
        1.0, "Time after the last goal before they do.", unit="s", ge=0.0, le=60.0
    )
    clear_on_shutdown: bool = parameter(False, "Whether maps forget their obstacles when they stop.", dynamic=False)
    restore_defaults: bool = parameter(False, "Set all dynamic parameters back to their configured values.")

    @model_validator(mode="after")
    def _commands_come_before_the_timeout(self) -> NavigationParameters:
        if self.command_timeout < 1.0 / self.controller_frequency:
            raise ValueError(
                f"a command_timeout ({self.command_timeout:g} s) of at least one control period "
                f"(controller_frequency {self.controller_frequency:g} Hz)"
            )
        return self
