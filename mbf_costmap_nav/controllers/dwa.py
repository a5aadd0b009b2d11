"""Dynamic window approach: try all velocities the robot can reach in one step, keep the one with the best arc.

When to use: robots that must get around obstacles that are not in the path, with little computing time (under 1 ms).
When not: it samples arcs of constant velocity only, so it stalls where a turn and a counter-turn are needed (narrow
S-shaped gaps, parking); ``costmap.mppi`` plans those. It does not follow a path exactly (``regulated_pure_pursuit``).

Formula: Fox, Burgard, Thrun 1997; the objective is the weighted sum of the trajectory critics instead of the paper's
three terms, and velocities are held for ``sim_time``.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.failures import no_motion
from mbf_abstract.maps.controllers.inertia import reached
from mbf_abstract.maps.controllers.motion_limits import MotionLimits
from mbf_abstract.maps.tracking.avoidance import MovingAround
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import ControlResult
from mbf_costmap_nav.control.path_handling import ControlCycle
from mbf_costmap_nav.control.sampling_follower import SamplingFollower, SamplingParameters
from mbf_costmap_nav.control.trajectory_scoring import is_free, roll_out, score
from mbf_costmap_nav.critics import CriticParameters
from mbf_costmap_nav.critics.obstacle_critic import COLLISION
from mbf_costmap_nav.kernels.control.rollout import clip_velocities
from mbf_costmap_nav.plugins import CostmapContext

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]


class DWAParameters(SamplingParameters):
    """Parameters of ``costmap.dwa``."""

    max_vel_x: float = parameter(0.5, "Largest forward speed.", unit="m/s", gt=0.0, le=20.0)
    min_vel_x: float = parameter(-0.1, "Least speed; negative = may drive back.", unit="m/s", ge=-20.0, le=0.0)
    max_vel_y: float = parameter(0.0, "Largest sideways speed; 0 = not holonomic.", unit="m/s", ge=0.0, le=20.0)
    max_vel_theta: float = parameter(1.6, "Largest yaw rate.", unit="rad/s", gt=0.0, le=20.0)
    acc_lim_x: float = parameter(2.5, "Largest forward acceleration.", unit="m/s^2", gt=0.0, le=100.0)
    acc_lim_y: float = parameter(2.5, "Largest sideways acceleration.", unit="m/s^2", gt=0.0, le=100.0)
    acc_lim_theta: float = parameter(3.2, "Largest yaw acceleration.", unit="rad/s^2", gt=0.0, le=100.0)
    window_time: float = parameter(0.2, "Time in which a sampled velocity must be reachable.", unit="s", gt=0.0, le=5.0)
    control_period: float | None = parameter(
        None,
        "Time between two calls; stated, no command changes by more until the next. Absent = window_time.",
        unit="s",
        gt=0.0,
        le=1.0,
    )
    sim_time: float = parameter(1.7, "How long a velocity is held in the simulation.", unit="s", gt=0.0, le=10.0)
    sim_step: float = parameter(0.05, "Step of the simulation.", unit="s", gt=0.0, le=0.5)
    vx_samples: int = parameter(15, "Samples of the forward speed.", ge=1, le=200)
    vy_samples: int = parameter(5, "Samples of the sideways speed.", ge=1, le=200)
    vtheta_samples: int = parameter(25, "Samples of the yaw rate.", ge=1, le=200)
    critics: CriticParameters = parameter(
        CriticParameters(path_align=6.0, path_follow=8.0, obstacle=3.0), "Weights of the trajectory critics."
    )


class DWAController(SamplingFollower):
    """Samples the dynamic window and scores the arcs."""

    Parameters: ClassVar[type[PluginParameters]] = DWAParameters
    parameters: DWAParameters

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self.parameters_changed()

    def parameters_changed(self) -> None:
        """Take over new limits."""
        p = self.parameters
        self._braking = np.array([p.acc_lim_x, p.acc_lim_y, p.acc_lim_theta])
        self.keep_with(self._period, p.sim_time, brakes=p.control_period is not None)

    @property
    def _period(self) -> float:
        """Time [s] in which a command must be reachable."""
        return self.parameters.control_period or self.parameters.window_time

    def limits(self, cycle: ControlCycle) -> MotionLimits:
        """Those of the window."""
        p, top = self.parameters, cycle.speed_limit
        gains = (self._period * self._braking).tolist()
        return MotionLimits(max(p.min_vel_x, -top), min(p.max_vel_x, top), p.max_vel_theta, False, *gains)

    @property
    def turns_on_the_spot(self) -> bool:
        """Always true."""
        return True

    @property
    def full_speed(self) -> float:
        """Largest speed in any direction [m/s]."""
        return max(self.parameters.max_vel_x, self.parameters.max_vel_y)

    def sampled(self, cycle: ControlCycle, around: MovingAround) -> ControlResult:
        """Sample, roll out, score, and take the cheapest arc that the full footprint can drive."""
        p = self.parameters
        candidates = self._window(cycle)
        steps = max(2, round(p.sim_time / p.sim_step))
        velocities = self._ramps(cycle, candidates, steps)
        rollouts = roll_out(cycle, velocities, p.sim_step, p.max_vel_x * p.sim_time)
        costs = score(p.critics, rollouts)
        met = around.meet(rollouts.poses, p.sim_step)
        hindered_by = around.hindering(met, costs)
        costs += met.costs
        checked_steps = round(p.check_ahead_time / cycle.limit_factor / p.sim_step)
        for sample in np.argsort(costs, kind="stable").tolist():
            if costs[sample] >= COLLISION:
                break
            command = self._reached(cycle, Twist.planar(*candidates[sample].tolist()))
            is_slowly = is_free(cycle, velocities[:, :checked_steps, sample], p.sim_step)
            velocity = np.array([command.vx, command.vy, command.wz])
            is_slowly = is_slowly and self.stops(cycle, velocity, self._braking, p.sim_step)
            if is_slowly and self._held_is_free(cycle, command, checked_steps * p.sim_step):
                return ControlResult(ExePathOutcome.SUCCESS, "", command, hindered_by)
        pose = cycle.request.pose
        text = f"all {len(candidates)} velocities reachable at ({pose.x:.2f}, {pose.y:.2f}) lead into an obstacle"
        return no_motion(self.costmap, pose, f"{text} within {p.sim_time:g} s")

    def _reached(self, cycle: ControlCycle, candidate: Twist) -> Twist:
        """A sampled velocity, or as much of the way to it as is driven until the next command."""
        if self.parameters.control_period is None:
            return candidate
        return reached(candidate, cycle.request.velocity, tuple((self._period * self._braking).tolist()))

    def _held_is_free(self, cycle: ControlCycle, command: Twist, duration: float) -> bool:
        """Whether the footprint is free for ``duration`` [s] where a robot drives that takes up a velocity at once.

        A quick robot does; the ramp is what a slow one drives. Only a first step that was looked at leads to where the
        arc of this cycle can be driven on in the next.
        """
        pose, step = cycle.request.pose, self.parameters.sim_step
        driven = arc_poses((pose.x, pose.y, pose.yaw), command.vx, command.vy, command.wz, max(duration, step), step)
        return cycle.footprint.first_collision(cycle.costmap, driven) < 0

    def _ramps(self, cycle: ControlCycle, candidates: FloatArray, steps: int) -> Float32Array:
        """Velocities (3, steps, n): from the measured one to each candidate at the accelerations allowed, then held."""
        p, now = self.parameters, cycle.request.velocity
        velocities = np.repeat(candidates.T.astype(np.float32)[:, None, :], steps, axis=1)
        change = np.array([p.acc_lim_x, p.acc_lim_y, p.acc_lim_theta], dtype=np.float32) * np.float32(p.sim_step)
        limit = np.array([np.inf, np.inf if p.max_vel_y > 0.0 else 0.0, np.inf], dtype=np.float32)
        measured = np.array([now.vx, now.vy, now.wz], dtype=np.float32)
        clip_velocities(velocities, measured, -limit, limit, change, 0.0, np.inf)
        return velocities

    def _window(self, cycle: ControlCycle) -> FloatArray:
        """Velocities (n, 3) the robot can reach within the window time."""
        p, now = self.parameters, cycle.request.velocity
        slowest, fastest = max(p.min_vel_x, -cycle.speed_limit), min(p.max_vel_x, cycle.speed_limit)
        vx = sample_window(now.vx, slowest, fastest, p.acc_lim_x * p.window_time, p.vx_samples)
        vy = np.zeros(1)
        if p.max_vel_y > 0.0:
            sideways = min(p.max_vel_y, cycle.speed_limit)
            vy = sample_window(now.vy, -sideways, sideways, p.acc_lim_y * p.window_time, p.vy_samples)
        wz = sample_window(now.wz, -p.max_vel_theta, p.max_vel_theta, p.acc_lim_theta * p.window_time, p.vtheta_samples)
        window = np.empty((len(vx), len(vy), len(wz), 3))
        window[..., 0], window[..., 1], window[..., 2] = vx[:, None, None], vy[:, None], wz
        return slowed_down(window.reshape(-1, 3), cycle.speed_limit)


def slowed_down(velocities: FloatArray, top_speed: float) -> FloatArray:
    """Velocities (n, 3) whose (vx, vy) is shortened to ``top_speed`` [m/s] where it is longer."""
    speeds = np.hypot(velocities[:, 0], velocities[:, 1])
    if speeds.max() <= top_speed:
        return velocities
    shares = np.divide(top_speed, speeds, out=np.ones_like(speeds), where=speeds > top_speed)
    return np.asarray(velocities * np.column_stack([shares, shares, np.ones_like(shares)]))


def sample_velocities(low: float, high: float, count: int) -> FloatArray:
    """At least two evenly spaced velocities from ``low`` to ``high``, and zero if it lies strictly between them."""
    if high <= low:
        return np.array([low])
    last = max(2, count) - 1
    samples = np.arange(last + 1.0) * ((high - low) / last) + low  # numpy.linspace, whose checks take most of its time
    samples[last] = high
    if low < 0.0 < high and not (samples == 0.0).any():
        samples = np.sort(np.append(samples, 0.0))
    return samples


def sample_window(current: float, low: float, high: float, change: float, count: int) -> FloatArray:
    """Velocities within ``change`` of the current one and within the limits; a robot beyond a limit comes back."""
    slowest, fastest = (min(max(velocity, low), high) for velocity in (current - change, current + change))
    return sample_velocities(slowest, fastest, count)
