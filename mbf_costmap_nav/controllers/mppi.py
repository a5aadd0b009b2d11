"""MPPI: sample thousands of noisy velocity sequences, weigh them by their cost, drive the mean.

When to use: the best of our controllers among obstacles; it swerves, backs up and threads gaps because every sample is
a whole manoeuvre of ``time_steps``, not an arc. Differential, omnidirectional and Ackermann robots. When not: very
small computers (a cycle of 2000 x 56 takes about 1 ms), or when the path must be followed to the centimetre.
Known failure: the mean of two equally good paths around an obstacle may collide; the footprint check then falls back to
the best single sample. A robot that can turn on the spot turns to a path that begins behind it. A car turns onto a path
at a right angle to its heading, but slowly where its turning radius is larger than its horizon
(``max_vel_x * time_steps * model_dt``); a car that faces back along its path drives it backward and ends with the wrong
heading. Give it paths that begin with its heading, as ``costmap.hybrid_astar`` does; near their cusps, and before goals
where it cannot turn, it keeps to them, and requests a new plan (NO_VALID_CMD) where it stands beside its goal.

Formula: information-theoretic MPPI (Williams et al. 2018, algorithm 2), with Nav2's structure of critics; the noise
comes from a pool drawn once from the plugin's generator, so that a cycle draws only an index. Deviation: the noise is
correlated in time (Vlahov et al. 2024, coloured noise), because independent noise hardly moves a standing robot.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import AckermannCommand, Command, Path, Twist
from mbf_abstract.maps.controllers.failures import no_motion
from mbf_abstract.maps.controllers.motion_limits import MotionLimits
from mbf_abstract.maps.tracking.avoidance import MovingAround
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import ControlResult, PlannedMotion
from mbf_costmap_nav.control.car_on_path import car_on_path
from mbf_costmap_nav.control.path_handling import ControlCycle
from mbf_costmap_nav.control.sampling_follower import SamplingFollower, SamplingParameters
from mbf_costmap_nav.control.sampling_noise import correlated_noise, smoothing_matrix
from mbf_costmap_nav.control.trajectory_scoring import is_free, roll_out, score
from mbf_costmap_nav.critics import CriticParameters
from mbf_costmap_nav.critics.obstacle_critic import COLLISION
from mbf_costmap_nav.kernels.control.rollout import add_noise, blend, clip_velocities, integrate
from mbf_costmap_nav.plugins import CostmapContext

Float32Array = NDArray[np.float32]

NOISE_POOL = 4
"""Sets of noise drawn at start; each cycle uses one of them."""
DEFAULT_RADIUS = 0.5
"""Turning radius [m] of a car where neither the parameters nor the robot give one."""
STANDSTILL, IDLE_CYCLES = 0.05, 60
"""A car commanded to drive slower than this [m/s] for so many cycles makes no progress and needs a new plan."""
FALLBACK_SAMPLES = 30
"""How many of the best single samples are tried when the mean does not fit."""


class MPPIParameters(SamplingParameters):
    """Parameters of ``costmap.mppi``."""

    motion_model: Literal["differential", "omni", "ackermann"] = parameter(
        "differential", "How the robot moves.", dynamic=False
    )
    batch_size: int = parameter(2000, "Sampled trajectories a cycle.", ge=10, le=100000, dynamic=False)
    time_steps: int = parameter(56, "Steps of a trajectory.", ge=9, le=500, dynamic=False)
    model_dt: float = parameter(0.05, "Length of a step; also the control period.", unit="s", gt=0.0, le=0.5)
    max_vel_x: float = parameter(0.5, "Largest forward speed.", unit="m/s", gt=0.0, le=20.0)
    min_vel_x: float = parameter(-0.35, "Least speed; negative = may drive back.", unit="m/s", ge=-20.0, le=0.0)
    max_vel_y: float = parameter(0.5, "Largest sideways speed (omni).", unit="m/s", ge=0.0, le=20.0)
    max_vel_theta: float = parameter(1.9, "Largest yaw rate.", unit="rad/s", gt=0.0, le=20.0)
    acc_lim_x: float = parameter(3.0, "Largest forward acceleration.", unit="m/s^2", gt=0.0, le=100.0)
    acc_lim_y: float = parameter(3.0, "Largest sideways acceleration.", unit="m/s^2", gt=0.0, le=100.0)
    acc_lim_theta: float = parameter(3.5, "Largest yaw acceleration.", unit="rad/s^2", gt=0.0, le=100.0)
    vx_std: float = parameter(0.2, "Noise of the forward speed.", unit="m/s", gt=0.0, le=10.0)
    vy_std: float = parameter(0.2, "Noise of the sideways speed.", unit="m/s", gt=0.0, le=10.0)
    wz_std: float = parameter(0.4, "Noise of the yaw rate.", unit="rad/s", gt=0.0, le=10.0)
    noise_correlation_time: float = parameter(
        0.5, "How long noise keeps its direction.", unit="s", gt=0.0, le=10.0, dynamic=False
    )
    min_turning_radius: float | None = parameter(
        None,
        "Turning radius of an Ackermann robot; absent = the robot's, or 0.5 m where that turns on the spot.",
        unit="m",
        ge=0.0,
        le=100.0,
    )
    wheelbase: float = parameter(
        0.0, "Above 0: answer Ackermann commands for this wheelbase.", unit="m", ge=0.0, le=20.0
    )
    temperature: float = parameter(0.3, "Small = only the best samples count.", gt=0.0, le=100.0)
    gamma: float = parameter(0.015, "Cost of leaving the nominal sequence.", ge=0.0, le=10.0)
    critics: CriticParameters = parameter(CriticParameters(), "Weights of the trajectory critics.")


class MPPIController(SamplingFollower):
    """Model predictive path integral control."""

    Parameters: ClassVar[type[PluginParameters]] = MPPIParameters
    parameters: MPPIParameters

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self._context, p = context, self.parameters
        shape = (NOISE_POOL, 3, p.time_steps, p.batch_size)
        self._noise = correlated_noise(self.rng, shape, math.exp(-p.model_dt / p.noise_correlation_time))
        self._velocities = np.empty(shape[1:], dtype=np.float32)
        self._poses = np.empty(shape[1:], dtype=np.float32)
        self._smoothing = smoothing_matrix(p.time_steps)
        self._idle_cycles, self._hindered_by = 0, ""
        self._nominal: Float32Array = np.zeros((3, p.time_steps), dtype=np.float32)
        self.parameters_changed()

    def parameters_changed(self) -> None:
        """Take over new limits."""
        p = self.parameters
        sideways = p.max_vel_y if p.motion_model == "omni" else 0.0
        self._low = np.array([p.min_vel_x, -sideways, -p.max_vel_theta], dtype=np.float32)
        self._high = np.array([p.max_vel_x, sideways, p.max_vel_theta], dtype=np.float32)
        self._change = np.array([p.acc_lim_x, p.acc_lim_y, p.acc_lim_theta], dtype=np.float32) * np.float32(p.model_dt)
        deviation = [p.vx_std, p.vy_std if p.motion_model == "omni" else 0.0, p.wz_std]
        self._deviation, self._radius = np.array(deviation, dtype=np.float32), self.turning_radius
        # Who stands within half of what is looked ahead, and turns no more by its end, stops on it, as good as.
        brakes = max(2.0 * p.max_vel_x / p.acc_lim_x, p.max_vel_theta / p.acc_lim_theta) > p.check_ahead_time
        self.keep_with(p.model_dt, p.model_dt * p.time_steps, brakes=brakes)
        if self._radius > 0.0:
            names = "max_vel_x", "max_vel_theta", "acc_lim_x", "max_path_distance"
            limits = {"min_turning_radius": self._radius, "allow_reversing": p.min_vel_x < 0.0}
            car = car_on_path(self._context, limits | {name: getattr(p, name) for name in names})
            car.tracker, self._keeping.car = self.tracker, car

    def limits(self, cycle: ControlCycle) -> MotionLimits:
        """Those of the samples."""
        p, top = self.parameters, cycle.speed_limit
        gains = p.acc_lim_x * p.model_dt, p.acc_lim_y * p.model_dt, p.acc_lim_theta * p.model_dt
        return MotionLimits(max(p.min_vel_x, -top), min(p.max_vel_x, top), p.max_vel_theta, self._radius > 0.0, *gains)

    def set_plan(self, path: Path) -> bool:
        """Take over a path; the nominal sequence is kept while driving, so that a new plan does not jerk."""
        if self.tracker is None:
            self._nominal[:] = 0.0
        self._idle_cycles = 0
        return super().set_plan(path)

    @property
    def turning_radius(self) -> float:
        """Radius [m] of the tightest curve, as configured or the robot's; 0 = turns on the spot."""
        p = self.parameters
        if p.motion_model != "ackermann":
            return 0.0
        return (self.min_turning_radius or DEFAULT_RADIUS) if p.min_turning_radius is None else p.min_turning_radius

    @property
    def turns_on_the_spot(self) -> bool:
        """Whether its motion model can turn on the spot."""
        return self._radius == 0.0

    @property
    def full_speed(self) -> float:
        """Largest speed in any direction [m/s]."""
        p = self.parameters
        return max(p.max_vel_x, p.max_vel_y) if p.motion_model == "omni" else p.max_vel_x

    def sampled(self, cycle: ControlCycle, around: MovingAround) -> ControlResult:
        """One cycle: sample around the nominal sequence, score, average, check, shift."""
        controls = self._optimise(cycle, around)
        if controls is None:  # start over from standing still: the old sequence may be what collides
            self._nominal[:] = 0.0
            controls = self._optimise(cycle, around)
        if controls is None:
            place = f"({cycle.request.pose.x:.2f}, {cycle.request.pose.y:.2f})"
            text = f"none of {self.parameters.batch_size} trajectories sampled at {place} is free of collision"
            return no_motion(self.costmap, cycle.request.pose, text)
        if self._is_stuck(controls):
            left = cycle.tracker.remaining
            text = f"no feasible motion of the car makes progress, {left:.2f} m before the end of its path"
            return ControlResult(ExePathOutcome.NO_VALID_CMD, text)
        self._nominal = np.concatenate([controls[:, 1:], controls[:, -1:]], axis=1)
        return ControlResult(ExePathOutcome.SUCCESS, "", self._command(controls[:, 0]), self._hindered_by)

    def _is_stuck(self, controls: Float32Array) -> bool:
        """Whether a car that drives ``controls`` has got nowhere for a while, without letting somebody by."""
        idle = self._radius > 0.0 and abs(controls[0, 0]) < STANDSTILL and not self._hindered_by
        self._idle_cycles = self._idle_cycles + 1 if idle else 0
        return self._idle_cycles > IDLE_CYCLES

    def planned_motion(self) -> PlannedMotion | None:
        """Return the nominal sequence; None where it keeps to the path instead."""
        motion = PlannedMotion(self._nominal.T.astype(np.float64), self.parameters.model_dt)
        return None if self._keeping.is_keeping else motion

    def _optimise(self, cycle: ControlCycle, around: MovingAround) -> Float32Array | None:
        """Best velocities (3, steps) around the nominal ones, or None if nothing fits."""
        p, velocities = self.parameters, self._velocities
        add_noise(self._nominal, self._noise[int(self.rng.integers(NOISE_POOL))], self._deviation, velocities)
        limits = *self._bounds(cycle), self._change, self._radius, cycle.speed_limit
        clip_velocities(velocities, *limits)
        reach = p.max_vel_x * p.model_dt * p.time_steps
        rollouts = roll_out(cycle, velocities, p.model_dt, reach, self._poses, self._radius)
        costs = score(p.critics, rollouts)
        if rollouts.collided.all():
            return None
        met = around.meet(rollouts.poses, p.model_dt)
        self._hindered_by = around.hindering(met, costs)
        costs += met.costs
        controls = blend(velocities, costs + self._control_cost(velocities), p.temperature, self._smoothing)[:, :, None]
        clip_velocities(controls, *limits)
        checked_steps = max(1, round(p.check_ahead_time / cycle.limit_factor / p.model_dt))
        best_touches = around.anybody and bool(met.touches[int(np.argmin(costs))])
        is_spoiled = around.anybody and not best_touches and self._meets(controls, cycle, around)
        if not is_spoiled and self._may_drive(cycle, controls[:, :checked_steps, 0]):
            return np.asarray(controls[:, :, 0])
        ranked = np.argsort(costs, kind="stable")[:FALLBACK_SAMPLES]
        if around.anybody and not best_touches:  # those that lead into somebody come last
            ranked = ranked[np.argsort(met.touches[ranked], kind="stable")]
        for sample in ranked.tolist():
            if costs[sample] < COLLISION and self._may_drive(cycle, velocities[:, :checked_steps, sample]):
                return np.ascontiguousarray(velocities[:, :, sample])
        return None

    def _may_drive(self, cycle: ControlCycle, controls: Float32Array) -> bool:
        """Whether velocities (3, steps) are free, and the first of them can be stopped."""
        p = self.parameters
        first, braking = controls[:, 0].astype(np.float64), self._change.astype(np.float64) / p.model_dt
        return self.stops(cycle, first, braking, p.model_dt) and is_free(cycle, controls, p.model_dt)

    def _meets(self, controls: Float32Array, cycle: ControlCycle, around: MovingAround) -> bool:
        """Whether the mean (3, steps, 1) meets somebody; that of passing in front of them and behind them may."""
        trajectory = np.empty_like(controls)
        integrate(controls, cycle.request.pose.yaw, self.parameters.model_dt, trajectory)
        return bool(around.meet(trajectory, self.parameters.model_dt).touches[0])

    def _bounds(self, cycle: ControlCycle) -> tuple[Float32Array, Float32Array, Float32Array]:
        """Measured velocity (3,), and the least and the largest one (3,) of this cycle."""
        measured = cycle.request.velocity
        now = np.array([measured.vx, measured.vy, measured.wz], dtype=np.float32)
        limit = np.array([cycle.speed_limit, cycle.speed_limit, np.inf], dtype=np.float32)
        return now, np.maximum(self._low, -limit), np.minimum(self._high, limit)

    def _control_cost(self, velocities: Float32Array) -> Float32Array:
        """(samples,) price of the first step's distance from the nominal one, per variance (Williams 2018, eq. 29)."""
        total = np.zeros(velocities.shape[2], dtype=np.float32)
        for nominal, sampled, deviation in zip(self._nominal[:, 0], velocities[:, 0], self._deviation, strict=True):
            if deviation > 0.0:
                total += nominal * (sampled - nominal) / (deviation * deviation)
        return np.asarray(np.float32(self.parameters.gamma) * total)

    def _command(self, velocity: Float32Array) -> Command:
        """Twist, or steering angle by the single-track model for a robot with a wheelbase."""
        vx, vy, wz = (float(component) for component in velocity)
        if self.parameters.wheelbase <= 0.0:
            return Twist.planar(vx, vy, wz)
        angle = math.atan(self.parameters.wheelbase * wz / vx) if abs(vx) > 1e-3 else 0.0
        return AckermannCommand(vx, angle)
