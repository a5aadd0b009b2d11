"""The motions that ``mesh.mppi`` tries: sampled controls, and what they make a robot of its motion model do."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mbf_abstract.geometry import AckermannCommand, Command, Twist
from mbf_abstract.geometry.arithmetic import tan
from mbf_abstract.maps.controllers.inertia import InertiaParameters
from mbf_abstract.maps.controllers.motion_limits import MotionLimits
from mbf_abstract.maps.controllers.standing import StandingParameters
from mbf_abstract.maps.tracking.avoidance import AvoidanceParameters
from mbf_abstract.parameters import parameter
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.kernels.motion.mppi import Critics
from mbf_mesh_nav.map.places import FORBIDDEN_COST
from mbf_mesh_nav.motion.goal_approach import clamp

_LEAST_STRIDE = 0.05  # [m] between two looks at the ground; only obstacles without inflation are thinner
_NOISE_HOLD = 3  # steps a noise value is kept for: explores further than independent noise of the same size
USUAL_WHEELBASE = 0.5  # [m] of a car that states none; it only scales the angles


class MPPIParameters(InertiaParameters):
    """Parameters of ``mesh.mppi``."""

    motion_model: Literal["differential", "ackermann"] = parameter("differential", "How the robot moves.")
    batch_size: int = parameter(400, "Motions tried in a cycle.", ge=10, le=10000)
    time_steps: int = parameter(30, "Steps of a motion.", ge=5, le=200)
    model_dt: float = parameter(0.1, "Length of a step.", unit="s", gt=0.0, le=1.0)
    temperature: float = parameter(0.15, "How much worse a motion may be and still count.", gt=0.0)
    max_vel_x: float = parameter(0.8, "Forward speed limit.", unit="m/s", gt=0.0, le=5.0)
    min_vel_x: float = parameter(0.0, "Least forward speed; negative allows reversing.", unit="m/s", le=0.0)
    max_vel_theta: float = parameter(1.0, "Yaw rate limit, in both directions.", unit="rad/s", gt=0.0, le=5.0)
    wheelbase: float = parameter(
        0.0,
        "Distance of the axles (Ackermann), for commands with a steering angle; 0 = commands with a yaw rate.",
        unit="m",
        ge=0.0,
    )
    max_steering_angle: float = parameter(0.5, "Steering limit (Ackermann).", unit="rad", gt=0.0, lt=1.5)
    vx_std: float = parameter(0.25, "Standard deviation of the speed samples.", unit="m/s", gt=0.0)
    wz_std: float = parameter(0.5, "Standard deviation of yaw rate (or steering) samples.", gt=0.0)
    decel_lim_x: float = parameter(0.4, "Deceleration planned before the goal.", unit="m/s^2", gt=0.0)
    path_weight: float = parameter(3.0, "Weight of the squared distance to the path.", ge=0.0)
    cost_weight: float = parameter(2.0, "Weight of the map's cost.", ge=0.0)
    tilt_weight: float = parameter(0.5, "Weight of roll and pitch over their limits, squared.", ge=0.0)
    turn_weight: float = parameter(0.05, "Weight of the squared yaw rate.", ge=0.0)
    goal_weight: float = parameter(2.0, "Weight of the path length left.", ge=0.0)
    heading_weight: float = parameter(0.5, "Weight of looking away from the path ahead.", ge=0.0)
    roll_limit: float = parameter(0.4, "Roll that counts 1.", unit="rad", gt=0.0, le=1.5)
    pitch_limit: float = parameter(0.5, "Pitch that counts 1.", unit="rad", gt=0.0, le=1.5)
    cost_limit: float = parameter(1.0, "Vertices whose cost reaches this are impassable.", gt=0.0, allow_inf=True)
    goal_distance: float = parameter(
        0.1, "Nearer to the goal than this the robot only turns to the final heading.", unit="m", gt=0.0, le=1000.0
    )
    max_path_distance: float = parameter(2.0, "Farther from the path than this it is missed.", unit="m", gt=0.0)
    max_surface_distance: float = parameter(
        1.0, "Farther from the surface than this the robot is out of the map.", unit="m", gt=0.0
    )
    moving_objects: AvoidanceParameters = parameter(AvoidanceParameters(), "How it keeps away from what moves.")
    standing: StandingParameters = parameter(StandingParameters(), "What it does where its motions get it nowhere.")


@dataclass(frozen=True)
class SampledMotions:
    """Controls and the motions they make: speed [m/s] and yaw rate [rad/s], or the steering angle [rad] of a car.

    Attributes
    ----------
    min_turning_radius : float
        Of the robot's tightest curve [m]; 0 = unknown.
    """

    parameters: MPPIParameters
    min_turning_radius: float

    @property
    def wheelbase(self) -> float:
        """Distance of the axles [m] of the car whose angles are sampled: its own, or any; the curves are the same."""
        return self.parameters.wheelbase or USUAL_WHEELBASE

    @property
    def steering_limit(self) -> float:
        """Largest steering angle [rad]: as configured, and no curve tighter than the robot's."""
        p = self.parameters
        if self.min_turning_radius == 0.0:
            return p.max_steering_angle
        return min(p.max_steering_angle, math.atan(self.wheelbase / self.min_turning_radius))

    @property
    def limits(self) -> MotionLimits:
        """What may be commanded; who may drive on ground that the map forbids does not leave it."""
        p = self.parameters
        is_car, leaves_contacts = p.motion_model == "ackermann", p.cost_limit <= FORBIDDEN_COST
        gain, turn_gain = p.acc_lim_x * p.control_period, p.acc_lim_theta * p.control_period
        speeds, gains = (p.min_vel_x, p.max_vel_x, p.max_vel_theta), (gain, gain, turn_gain)
        return MotionLimits(*speeds, is_car, *gains, leaves_contacts=leaves_contacts)

    @property
    def turning_radius(self) -> float:
        """Radius [m] of a car's tightest curve."""
        return self.wheelbase / math.tan(self.steering_limit)

    def sampled(
        self,
        rng: np.random.Generator,
        nominal: FloatArray,
        max_speed: float,
        remaining: float,
        measured: Twist,
        *,
        reverses: bool,
    ) -> FloatArray:
        """Controls (batch_size, time_steps, 2) around ``nominal``; the first are those, the second stand still.

        None changes faster than a robot can that is ``measured`` to move so.
        No robot that can turn where it stands goes on past the goal, ``remaining`` [m] away: motions that run beyond it
        would speak for creeping there.
        """
        p = self.parameters
        held = -(-p.time_steps // _NOISE_HOLD)
        # Two parts: one that changes, and one that lasts; only lasting turns lead round an obstacle.
        noise = rng.standard_normal((p.batch_size, held, 2)) + rng.standard_normal((p.batch_size, 1, 2))
        noise *= (p.vx_std, p.wz_std)
        noise = np.repeat(noise, _NOISE_HOLD, axis=1)[:, : p.time_steps]
        noise[0] = 0.0
        controls = nominal + noise
        controls[1] = 0.0
        slowest = max(p.min_vel_x, -max_speed) if reverses else p.min_vel_x
        np.clip(controls[..., 0], slowest, max_speed, out=controls[..., 0])
        if p.motion_model == "differential":
            before = np.cumsum(controls[..., 0], axis=1) - controls[..., 0]
            room = np.maximum(remaining / p.model_dt - before, 0.0)
            np.minimum(controls[..., 0], room, out=controls[..., 0])
        turn_limit = p.max_vel_theta if p.motion_model == "differential" else self.steering_limit
        np.clip(controls[..., 1], -turn_limit, turn_limit, out=controls[..., 1])
        self._limit_changes(controls, measured)
        return np.asarray(controls)

    def braked(self, control: FloatArray) -> FloatArray | None:
        """Controls (time_steps, 2) that brake on the arc of ``control`` (2,) after a period of it; None = at once.

        A car keeps its wheels as they are.
        """
        p, (speed, turn) = self.parameters, control.tolist()
        if p.acc_lim_x == math.inf:
            return None
        is_car = p.motion_model == "ackermann"
        stops_after = max(p.stops_after(Twist.planar(speed, wz=0.0 if is_car else turn)), 1e-9)
        ends = p.control_period + stops_after - p.model_dt * (np.arange(p.time_steps) + 0.5)
        shares = np.clip(ends / stops_after, 0.0, 1.0)
        return np.column_stack([speed * shares, np.full_like(shares, turn) if is_car else turn * shares])

    def _limit_changes(self, controls: FloatArray, measured: Twist) -> None:
        """Let controls (n, time_steps, 2) change from step to step as the robot can; steering angles at once."""
        p = self.parameters
        turning = p.acc_lim_theta if p.motion_model == "differential" else math.inf
        for component, acceleration, now in ((0, p.acc_lim_x, measured.vx), (1, turning, measured.wz)):
            if acceleration < math.inf:
                last, change = np.full(len(controls), now), acceleration * min(p.model_dt, p.control_period)
                for step in controls[..., component].T:  # the first is what is commanded until the next cycle
                    np.clip(step, last - change, last + change, out=step)
                    last, change = step, acceleration * p.model_dt

    def driven(self, controls: FloatArray) -> FloatArray:
        """Speeds and yaw rates (..., 2) that controls (..., 2) lead to."""
        if self.parameters.motion_model != "ackermann":
            return controls
        yaw_rates = controls[..., 0] * tan(controls[..., 1]) / self.wheelbase
        return np.stack([controls[..., 0], yaw_rates], axis=-1)

    def command(self, speed: float, turn: float) -> Command:
        """Controls as a command."""
        if self.parameters.motion_model == "differential":
            return Twist.planar(vx=speed, wz=turn)
        angle = clamp(turn, self.steering_limit)
        if self.parameters.wheelbase == 0.0:
            return Twist.planar(vx=speed, wz=speed * math.tan(angle) / self.wheelbase)
        return AckermannCommand(speed, angle)


def pieces_of_a_step(p: MPPIParameters, shortest_edge: float) -> int:
    """Into how many pieces a step is cut, so that none leads from one side of a thin wall to the other.

    Forbidden is the ground half an edge on both sides of a row of lethal vertices; the row may run where the mesh is
    finest, with edges of ``shortest_edge`` [m].
    """
    stride = max(p.max_vel_x, -p.min_vel_x) * p.model_dt
    return math.ceil(stride / max(0.5 * shortest_edge, _LEAST_STRIDE))


def critics(p: MPPIParameters, strictness: float) -> Critics:
    """What makes a motion good; before a bent end the path is followed so many times more strictly."""
    path_weight = strictness * p.path_weight
    weights = path_weight, p.cost_weight, p.tilt_weight, p.turn_weight, p.goal_weight, p.heading_weight
    return Critics(np.array(weights), p.roll_limit, p.pitch_limit)
