"""Fleets for ``moving.py`` whose robots are not alike: shapes, sizes, drives, speeds, controllers and maps are drawn.

A fleet shares a world that is stretched so that its largest robot has the room that the usual one has in the usual
world. Each robot is configured by what it can do; all other parameters are those of ``moving.yaml`` and
``moving_mesh.yaml``.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from terrain.description.parameters import UrdfRobot
from terrain.physics.robot_models import URDF_FOLDER, rectangle
from terrain.scenarios.noise import LocalizationNoise
from terrain.scenarios.perturbation import Perturbation
from terrain.scenarios.robots import Sensor

USUAL_HALF_WIDTH, USUAL_REACH = 0.2, 0.3  # m, of the robots that the worlds have room for
MARGIN = 0.2  # m, between a robot that has pulled out and one like it that passes
HALF_EDGE = 0.05  # m, of the meshes: between its vertices a map knows no more
WHEELBASE, STEERING_ANGLE = 0.6, 0.6  # share of the length of a car, rad
CONTROLLERS = {
    "costmap": ("regulated_pure_pursuit", "dwa", "mppi", "follow_path"),
    "mesh": ("path_follower", "mppi", "vector_field", "follow_path"),
}
PERIOD = 0.05  # s, of moving.yaml and moving_mesh.yaml


@dataclass(frozen=True)
class FleetRobot:
    """What one robot is and how it drives; [m], [m/s], [rad/s], [m/s^2], [rad/s^2], delay [s], noise [m] and [deg].

    Attributes
    ----------
    length : float
        0 = a disc of ``half_width``.
    drive : str
        As of ``UrdfRobot``; ``omni`` and ``ackermann`` beside ``differential``.
    """

    backend: str
    controller: str
    drive: str
    length: float
    half_width: float
    max_speed: float
    max_yaw_rate: float
    max_acceleration: float
    max_yaw_acceleration: float
    range_noise: float
    command_delay: float
    position_noise: float
    yaw_noise: float

    @property
    def reach(self) -> float:
        """How far its outline is from its base."""
        return math.hypot(0.5 * self.length, self.half_width) if self.length else self.half_width

    @property
    def turning_radius(self) -> float:
        """Of a car; 0 for others."""
        return WHEELBASE * self.length / math.tan(STEERING_ANGLE) if self.drive == "ackermann" else 0.0

    @property
    def stretch(self) -> float:
        """How much larger its world is than usual."""
        return max(self.half_width / USUAL_HALF_WIDTH, self.reach / USUAL_REACH, self.turning_radius / 0.4)

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """Corners; of a disc 16 around it."""
        if self.length:
            return rectangle(-0.5 * self.length, 0.5 * self.length, self.half_width)
        outer = self.half_width / math.cos(math.pi / 16)
        angles = [math.pi * (k + 0.5) / 8 for k in range(16)]
        return tuple((outer * math.cos(angle), outer * math.sin(angle)) for angle in angles)

    def simulated(self) -> UrdfRobot:
        """The robot as a scenario has it; its lidar sees robots of all heights."""
        is_car = self.drive == "ackermann"
        return UrdfRobot(
            urdf=str(URDF_FOLDER / ("car.urdf" if is_car else "turtlebot.urdf")),
            drive=self.drive,
            footprint=self.outline,
            height=0.4,
            wheelbase=WHEELBASE * self.length if is_car else None,
            max_steering_angle=STEERING_ANGLE if is_car else None,
            max_speed=self.max_speed,
            max_yaw_rate=self.max_yaw_rate,
            max_acceleration=self.max_acceleration,
            max_yaw_acceleration=self.max_yaw_acceleration,
            lidar_position=(0.0, 0.0, 0.3),
        )

    def parts(self) -> dict[str, Any]:
        """What is its own in a scenario, beside its configuration."""
        return {
            "robot": self.simulated(),
            "backend": self.backend,
            "sensors": (Sensor(max_range=8.0, noise=self.range_noise),),
            "localization": LocalizationNoise(position_noise=self.position_noise, yaw_noise=self.yaw_noise),
            "perturb": Perturbation(command_delay=self.command_delay),
        }


@dataclass(frozen=True)
class Fleet:
    """Robots that share a world."""

    robots: tuple[FleetRobot, ...]

    @property
    def stretch(self) -> float:
        """How much larger their world is than usual."""
        return max(1.0, *(robot.stretch for robot in self.robots))

    @property
    def patience(self) -> float:
        """How much longer than usual the way through their world may take."""
        return self.stretch * max(1.0, *(0.5 / robot.max_speed for robot in self.robots))


def drawn_fleet(case: str, seed: int, size: int, on: str) -> Fleet:
    """Draw the robots of a case; on ``both`` each has a map of its own kind."""
    rng = np.random.default_rng([seed, zlib.crc32(case.encode()), zlib.crc32(b"fleet")])
    return Fleet(tuple(_drawn_robot(rng, on) for _ in range(size)))


def _drawn_robot(rng: np.random.Generator, on: str) -> FleetRobot:
    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    drawn_backend = str(rng.choice(["costmap", "mesh"]))
    backend = {"costmap": "costmap", "both": drawn_backend}.get(on, "mesh")
    controller = CONTROLLERS[backend][int(rng.integers(4))]
    drive = str(rng.choice(["differential", "differential", "omni", "ackermann"]))
    is_disc, length, half_width = bool(rng.random() < 0.5), between(0.35, 0.9), between(0.12, 0.35)
    if backend == "mesh":  # plans there are for discs
        is_disc, drive = True, "differential"
    if drive == "ackermann":
        is_disc, controller = False, "regulated_pure_pursuit"
    speed, yaw_rate = between(0.2, 1.2), between(0.6, 2.0)
    return FleetRobot(
        backend=backend,
        controller=controller,
        drive=drive,
        length=0.0 if is_disc else length,
        half_width=half_width if is_disc else min(half_width, 0.4 * length),
        max_speed=speed,
        max_yaw_rate=yaw_rate,
        max_acceleration=max(between(0.3, 2.0), speed / 3.0),
        max_yaw_acceleration=max(between(0.6, 4.0), yaw_rate / 3.0),
        range_noise=float(rng.uniform(0.0, 0.03)),
        command_delay=float(rng.uniform(0.0, 0.15)),
        position_noise=float(rng.uniform(0.0, 0.01)),
        yaw_noise=float(rng.uniform(0.0, 0.5)),
    )


# ------------------------------------------------------------------------------------------------- configurations
def write_configuration(robot: FleetRobot, fleet: Fleet, base: Path, file: Path) -> Path:
    """Write the configuration of a robot, made of the usual one; returns its file."""
    settings = yaml.safe_load(base.read_text(encoding="utf-8"))
    for usual in settings["controllers"]:
        settings.pop(usual["name"], None)
    settings |= {
        "max_vel_x": robot.max_speed,
        "min_vel_x": -robot.max_speed,
        "max_vel_y": robot.max_speed if robot.drive == "omni" else 0.0,
        "max_vel_theta": robot.max_yaw_rate,
        "command_delay": robot.command_delay,
        "controllers": [{"name": "controller", "type": robot.controller}],
        "controller": _controller(robot),
    }
    if robot.turning_radius:
        settings |= {"min_turning_radius": robot.turning_radius, "planners": [_planner("hybrid_astar")]}
    if robot.controller == "vector_field":  # which takes the plans of no other planner
        settings["planners"] = [_planner("cvp")]
    for name in ("give_way", "yield_1", "yield_2", "yield_3"):
        given = {"distance": robot.reach + robot.half_width + MARGIN, "reach": min(9.0 * fleet.stretch, 20.0)}
        slowly = {"speed": min(0.3, robot.max_speed), "yaw_rate": min(0.8, robot.max_yaw_rate)}
        settings[name] = settings[name] | given | slowly
    _describe_body(settings, robot)
    file.write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")
    return file


def _planner(kind: str) -> dict[str, str]:
    return {"name": kind, "type": kind}


def _controller(robot: FleetRobot) -> dict[str, Any]:
    """Parameters of its controller: what it can do, where the controller asks for it."""
    kind, given = robot.controller, {"max_vel_x": robot.max_speed, "max_vel_theta": robot.max_yaw_rate}
    limits = {"acc_lim_x": robot.max_acceleration, "acc_lim_theta": robot.max_yaw_acceleration}
    if kind in ("dwa", "mppi") and robot.backend == "costmap":
        side = robot.max_speed if robot.drive == "omni" else 0.0
        limits |= {"acc_lim_y": robot.max_acceleration, "max_vel_y": side, "min_vel_x": -min(0.1, robot.max_speed)}
        if kind == "mppi":
            limits |= {"motion_model": "omni" if side else "differential"}
    if kind == "regulated_pure_pursuit":
        limits |= {"rotate_to_heading_vel": robot.max_yaw_rate, "rotate_to_heading": robot.drive != "ackermann"}
    return given | limits | ({} if kind == "mppi" and robot.backend == "costmap" else {"control_period": PERIOD})


def _describe_body(settings: dict[str, Any], robot: FleetRobot) -> None:
    """Describe outline and braking to the maps."""
    brakes = {"decel_lim_x": robot.max_acceleration, "decel_lim_theta": robot.max_yaw_acceleration}
    moving = {"max_vel_x": robot.max_speed, **brakes}
    if robot.backend == "mesh":
        radius = {"inscribed_radius": robot.half_width + HALF_EDGE}
        settings["mesh_map"] |= radius
        for layer in ("inflation", "obstacle_inflation"):
            settings["mesh_map"][layer] |= radius | {"inflation_radius": robot.half_width + 0.3}
        settings["mesh_map"]["moving"] |= radius | moving
        return
    for name, beyond in (("global_costmap", 0.3), ("local_costmap", 0.2)):
        costmap = settings[name]
        del costmap["robot_radius"]
        corners = [list(corner) for corner in robot.outline]
        costmap |= {"footprint": corners} if robot.length else {"robot_radius": robot.half_width}
        costmap["inflation"]["inflation_radius"] = robot.reach + beyond
        costmap["moving"] |= moving


def stretched(free: NDArray[np.bool_], factor: float) -> NDArray[np.bool_]:
    """A floor made larger, in cells of the same size."""
    rows, columns = (np.minimum((np.arange(round(n * factor)) + 0.5) / factor, n - 0.5).astype(int) for n in free.shape)
    return free[np.ix_(rows, columns)]


def commands_beyond(fleet: Fleet, commands: Sequence[FloatArray]) -> int:
    """How many of the commands (n, 3: m/s, m/s, rad/s) of each robot ask for more speed than it has."""
    beyond = 0
    for robot, own in zip(fleet.robots, commands, strict=True):
        side = robot.max_speed if robot.drive == "omni" else 0.0
        most = 1.001 * np.array([robot.max_speed, side, robot.max_yaw_rate]) + 1e-9
        beyond += int((np.abs(own) > most).any(axis=1).sum())
    return beyond
