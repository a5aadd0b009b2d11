"""Model predictive path integral control on the surface: sample motions, roll them out on the mesh, blend the best.

Strengths: reads the map of *now*, so it drives round obstacles seen after planning; knows slopes, costs and the robot's
motion model (differential or Ackermann). Known failure: a local method with a horizon of ``time_steps * model_dt``;
a deeper pocket needs a new plan. An Ackermann robot cannot correct its heading on the spot; it
arrives on a curve along the goal's heading, if free space allows one. It drives a path whose poses require reversing
cusp after cusp where ``min_vel_x`` allows reversing, and refuses it otherwise.
Cost: about 3 ms a cycle with 400 samples of 30 steps; that many times more as a step is longer than half
the shortest edge of the mesh, or than 0.05 m if that is more.

Method: Williams et al., "Information theoretic MPC for model-based reinforcement learning", ICRA 2017, algorithm 2,
with noise that partly lasts and partly changes, and a last check that the blended motion itself is free.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from mbf_abstract.geometry import AckermannCommand, Command, Path, Pose, Twist
from mbf_abstract.geometry.arithmetic import exp, norm, tan
from mbf_abstract.geometry.polyline import reverse_segments
from mbf_abstract.geometry.tangent_plane import ground_distance, heading_error
from mbf_abstract.maps.controllers.failures import missed_path
from mbf_abstract.maps.tracking.avoidance import AvoidanceParameters, Encounters, MovingAround
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import ControlRequest, ControlResult, PlannedMotion
from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray
from mbf_mesh_nav.kernels.mesh.surface_walk import tangent
from mbf_mesh_nav.kernels.motion.mppi import score_rollouts
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.positions import vector_of
from mbf_mesh_nav.motion.goal_approach import GoalApproach, braking_speed, clamp, tracker_on_surface
from mbf_mesh_nav.motion.surface_follower import SurfaceFollower
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.search.final_approach import with_final_approach, with_first_turn

_NOISE_HOLD = 3  # steps a noise value is kept for: explores further than independent noise of the same size
_LEAST_STRIDE = 0.05  # [m] between two looks at the ground; only obstacles without inflation are thinner
_PATH_SPACING = 0.1  # [m] between the samples of the path ahead
_COLLISION_SCORE = 1e6
_ROOM_TO_STEER = 1.2  # radius of the approach to the goal, in least turning radii
_STRICT_RADII = 8.0  # before the goal at which a bent approach begins to be followed ...
_STRICTNESS = 10.0  # ... so many times more closely: a car that cuts it arrives with the wrong heading
_STANDSTILL = 0.2  # [m] and [rad] gained over the horizon: less than this is no motion
_IDLE_CYCLES = 20  # without motion, after which there is none that gets on
_RUN_OUT = np.array([[0.1], [0.2], [0.3]])  # [m] beyond the end of a section that a car drives


class MPPIParameters(PluginParameters):
    """Parameters of ``mesh.mppi``."""

    motion_model: Literal["differential", "ackermann"] = parameter("differential", "How the robot moves.")
    batch_size: int = parameter(400, "Motions tried in a cycle.", ge=10, le=10000)
    time_steps: int = parameter(30, "Steps of a motion.", ge=5, le=200)
    model_dt: float = parameter(0.1, "Length of a step.", unit="s", gt=0.0, le=1.0)
    temperature: float = parameter(0.15, "How much worse a motion may be and still count.", gt=0.0)
    max_vel_x: float = parameter(0.8, "Forward speed limit.", unit="m/s", gt=0.0, le=5.0)
    min_vel_x: float = parameter(0.0, "Least forward speed; negative allows reversing.", unit="m/s", le=0.0)
    max_vel_theta: float = parameter(1.0, "Yaw rate limit, in both directions.", unit="rad/s", gt=0.0, le=5.0)
    wheelbase: float = parameter(0.5, "Distance of the axles (Ackermann).", unit="m", gt=0.0)
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
        0.1, "Nearer to the goal than this the robot only turns to the final heading.", unit="m", gt=0.0
    )
    max_path_distance: float = parameter(2.0, "Farther from the path than this it is missed.", unit="m", gt=0.0)
    max_surface_distance: float = parameter(
        1.0, "Farther from the surface than this the robot is out of the map.", unit="m", gt=0.0
    )
    moving_objects: AvoidanceParameters = parameter(AvoidanceParameters(), "How it keeps away from what moves.")


class MPPIController(SurfaceFollower):
    """Sampling controller that avoids what the map shows now."""

    Parameters = MPPIParameters
    parameters: MPPIParameters

    _hindered_by = ""

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._shortest_edge = float(self.mesh_map.neighbour_lengths.min())
        self._ranks_of: tuple[int, float] = (-1, 0.0)  # version of the map and cost limit
        self._ranks: Float32Array = np.zeros(0, dtype=np.float32)

    @classmethod
    def reach(cls, parameters: MPPIParameters) -> float:
        """To the end of the longest motion it tries, from a robot beside the surface."""
        speed = max(parameters.max_vel_x, -parameters.min_vel_x)
        return speed * parameters.time_steps * parameters.model_dt + parameters.max_surface_distance

    def set_plan(self, path: Path) -> bool:
        """Take over a path of at least one pose in the map's frame; not one in reverse for a car that may not."""
        if len(path) == 0 or path.frame_id != self.mesh_map.frame_id:
            return False
        p, is_car = self.parameters, self.parameters.motion_model == "ackermann"
        self._reverses = is_car and bool(reverse_segments(path, path.positions).any())
        if self._reverses and p.min_vel_x == 0.0:
            return False
        self._approach = GoalApproach(path[-1], p.goal_distance)
        self._strict_below = 0.0
        if is_car and not self._reverses:
            bent = with_final_approach(path, self.mesh_map, self._blocked(), _ROOM_TO_STEER * self._turning_radius)
            self._strict_below = _STRICT_RADII * self._turning_radius if bent is not path else 0.0
            path = bent
        self._begun, self._idle_cycles = False, 0
        self._follow(path)
        self._nominal: FloatArray = np.zeros((p.time_steps, 2))
        return True

    @property
    def turns_on_the_spot(self) -> bool:
        """Whether its motion model can turn on the spot."""
        return self.parameters.motion_model == "differential"

    @property
    def _steering_limit(self) -> float:
        """Largest steering angle [rad]: as configured, and no curve tighter than the robot's."""
        p = self.parameters
        if self.min_turning_radius == 0.0:
            return p.max_steering_angle
        return min(p.max_steering_angle, math.atan(p.wheelbase / self.min_turning_radius))

    @property
    def _turning_radius(self) -> float:
        """Radius [m] of a car's tightest curve."""
        return self.parameters.wheelbase / math.tan(self._steering_limit)

    def _follow(self, path: Path) -> None:
        self._tracker = tracker_on_surface(self.mesh_map, path, self.parameters.max_surface_distance)

    def _begin(self, spot: SurfacePoint, pose: Pose) -> None:
        """Prepend a curve that leads a car of another heading onto its path, now that its pose is known."""
        p, path = self.parameters, self._tracker.path
        self._begun = True
        if p.motion_model == "ackermann" and not self._reverses:
            radius = _ROOM_TO_STEER * self._turning_radius
            self._tracker.update(spot.point)
            ahead = Path.from_points(self._tracker.ahead(math.inf), path[-1].orientation, None, path.frame_id)
            bent = with_first_turn(ahead, self.mesh_map, self._blocked(), radius, pose)
            if bent is not ahead:
                self._follow(bent)

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """One cycle: locate, sample around the last motion, score, blend, check."""
        p, pose = self.parameters, request.pose
        cycle = self.begin_cycle(pose, p.max_surface_distance)
        if isinstance(cycle, ControlResult):
            return cycle
        spot, approach = cycle
        if not self._begun:
            self._begin(spot, pose)
        self._tracker.update(spot.point)
        if missed := missed_path(self._tracker, p.max_path_distance * self.limit_factor):
            return missed
        if approach.is_only_turning(pose, self._tracker):
            off = heading_error(pose, approach.goal)
            self._idle_cycles += p.motion_model == "ackermann"
            if self._idle_cycles > _IDLE_CYCLES:
                message = f"the goal is reached but for {off:.2f} rad, which a car cannot correct where it stands"
                return ControlResult(ExePathOutcome.NO_VALID_CMD, message)
            turn = clamp(2.0 * off, p.max_vel_theta)
            return ControlResult(ExePathOutcome.SUCCESS, "", self._as_command(0.0, turn))
        motion = self._best_motion(spot, pose)
        if motion is None:
            return ControlResult(ExePathOutcome.NO_VALID_CMD, "no sampled motion is collision-free and makes progress")
        self._nominal = np.concatenate([motion[1:], motion[-1:]])
        command = self._as_command(float(motion[0, 0]), float(motion[0, 1]))
        return ControlResult(ExePathOutcome.SUCCESS, "", command, self._hindered_by)

    def planned_motion(self) -> PlannedMotion | None:
        """Return the last motion, without its first step."""
        if self._approach is None:
            return None
        speed, yaw_rate = np.moveaxis(self._as_motions(self._nominal), -1, 0)
        return PlannedMotion(np.stack([speed, np.zeros_like(speed), yaw_rate], axis=1), self.parameters.model_dt)

    def _best_motion(self, spot: SurfacePoint, pose: Pose) -> FloatArray | None:
        """Blend the sampled motions by their scores; (time_steps, 2), or None if no motion makes progress."""
        max_speed = min(
            self.parameters.max_vel_x, max(braking_speed(self._tracker.to_cusp, self.parameters.decel_lim_x), 0.1)
        )
        # A robot beside its goal or past it has no path ahead of it, but still a distance to drive.
        end = self._tracker.point_at(self._tracker.next_cusp)
        to_end = float(norm(end - spot.point))
        controls = self._sample(max_speed, max(self._tracker.to_cusp, to_end))
        around = MovingAround.on(self.mesh_map, pose, self.clock.now(), self.parameters.moving_objects)
        scores, collided, met = self._score(controls, spot, pose, around)
        scores = np.where(collided, scores + _COLLISION_SCORE, scores)
        self._hindered_by = around.hindering(met, scores)
        scores = scores + met.costs
        weights = exp(-(scores - scores.min()) / self.parameters.temperature)
        blended = np.asarray(((weights / weights.sum())[:, None, None] * controls).sum(axis=0))
        # The mean of two free motions, left and right of an obstacle or of somebody, may hit it.
        best = int(np.argmin(scores))
        _, hits, mean_met = self._score(blended[None], spot, pose, around)
        if hits[0] or (mean_met.touches[0] and not met.touches[best]):
            blended = np.asarray(controls[best])
        # Where most motions collide and the best one hardly moves, standing there would last for ever. So it would
        # where none leads nearer, as for a car that has passed its goal; a cycle or two of it are chance. A robot that
        # lets somebody by only waits.
        travel, turn = np.abs(blended.sum(axis=0)) * self.parameters.model_dt
        stands = travel < _STANDSTILL and turn < _STANDSTILL
        if stands and not self._hindered_by:  # motions into somebody collide with the ground marked below them
            self._hindered_by = around.hindering(met, np.where(met.touches, scores, np.inf))
        if stands and not self._hindered_by and collided.mean() > 0.5:  # so do those that end before they meet
            self._hindered_by = around.nearest(self.parameters.max_vel_x * len(blended) * self.parameters.model_dt)
        stands = stands and not self._hindered_by
        has_far_to_go = self._distance_to_goal(pose) > _STANDSTILL + self.parameters.goal_distance
        self._idle_cycles = self._idle_cycles + 1 if stands and has_far_to_go else 0
        stuck = stands and (collided.mean() > 0.5 or self._idle_cycles > _IDLE_CYCLES)
        return None if stuck or bool(collided.all()) else blended

    def _distance_to_goal(self, pose: Pose) -> float:
        assert self._approach is not None
        return ground_distance(pose, self._approach.goal)

    def _sample(self, max_speed: float, remaining: float) -> FloatArray:
        """Motions (batch_size, time_steps, 2) around the last one; the first is that one, the second stands still.

        No robot that can turn where it stands goes on past the goal, ``remaining`` [m] away: motions that run beyond it
        would speak for creeping there.
        """
        p = self.parameters
        held = -(-p.time_steps // _NOISE_HOLD)
        # Two parts: one that changes, and one that lasts; only lasting turns lead round an obstacle.
        noise = self.rng.standard_normal((p.batch_size, held, 2)) + self.rng.standard_normal((p.batch_size, 1, 2))
        noise *= (p.vx_std, p.wz_std)
        noise = np.repeat(noise, _NOISE_HOLD, axis=1)[:, : p.time_steps]
        noise[0] = 0.0
        controls = self._nominal + noise
        controls[1] = 0.0
        slowest = max(p.min_vel_x, -max_speed) if self._reverses else p.min_vel_x
        np.clip(controls[..., 0], slowest, max_speed, out=controls[..., 0])
        if p.motion_model == "differential":
            before = np.cumsum(controls[..., 0], axis=1) - controls[..., 0]
            room = np.maximum(remaining / p.model_dt - before, 0.0)
            np.minimum(controls[..., 0], room, out=controls[..., 0])
        turn_limit = p.max_vel_theta if p.motion_model == "differential" else self._steering_limit
        np.clip(controls[..., 1], -turn_limit, turn_limit, out=controls[..., 1])
        return np.asarray(controls)

    def _score(
        self, controls: FloatArray, spot: SurfacePoint, pose: Pose, around: MovingAround
    ) -> tuple[FloatArray, BoolArray, Encounters]:
        """Scores (n,) of motions, collisions (n,) on the map of now, and what moves that they meet."""
        p, mesh_map = self.parameters, self.mesh_map
        snapshot = mesh_map.snapshot()
        pieces = self._pieces_of_a_step()
        motions = np.repeat(self._as_motions(controls), pieces, axis=1)
        ahead, remaining = self._path_ahead()
        poses = np.empty((3, motions.shape[1] if around.anybody else 0, len(motions)), dtype=np.float32)
        scores, collided = score_rollouts(
            mesh_map.topology.surface,
            snapshot.costs,
            self._ranks_at(snapshot),
            spot.face,
            vector_of(spot.point),
            tangent(vector_of(pose.rotation[:, 0]), vector_of(mesh_map.face_normals[spot.face])),
            motions,
            p.model_dt / pieces,
            ahead,
            remaining,
            self._weights(),
            (p.roll_limit, p.pitch_limit),
            -1.0 if self._backward else 1.0,
            poses,
        )
        return scores, collided, around.meet(poses, p.model_dt / pieces)

    @property
    def _backward(self) -> bool:
        """Whether the present section of the path is driven in reverse."""
        return self._reverses and self._tracker.driving_backward

    def _weights(self) -> FloatArray:
        """Weights of the critics, in the order of ``score_rollouts``."""
        p = self.parameters
        path_weight = (_STRICTNESS if self._tracker.remaining < self._strict_below else 1.0) * p.path_weight
        return np.array([path_weight, p.cost_weight, p.tilt_weight, p.turn_weight, p.goal_weight, p.heading_weight])

    def _path_ahead(self) -> tuple[FloatArray, FloatArray]:
        """Points (n, 3) of the path that motions can reach, and the length (n,) [m] of it that is left from each."""
        p, tracker = self.parameters, self._tracker
        reach = p.max_vel_x * p.time_steps * p.model_dt + 1.0
        end = min(tracker.progress + reach, tracker.next_cusp)
        along = np.append(np.arange(tracker.progress, end, _PATH_SPACING), end)
        ahead, remaining = tracker.points_at(along), tracker.next_cusp - along
        if p.motion_model == "ackermann" and (end == tracker.length or (self._reverses and end == tracker.next_cusp)):
            # Beyond the end, for the critic that looks along the path: it shows how to stand there. A cusp draws the
            # car past itself, or it would creep to it.
            ahead = np.concatenate([ahead, self._run_out(end)])
            beyond = np.zeros(len(_RUN_OUT)) if end == tracker.length else -_RUN_OUT[:, 0]
            remaining = np.append(remaining, beyond)
        return ahead, remaining

    def _run_out(self, end: float) -> FloatArray:
        """Points (3, 3) straight on beyond ``end`` [m] of the path: beyond a cusp, or beyond the goal as it looks."""
        tracker = self._tracker
        if end == tracker.length:
            assert self._approach is not None
            goal = self._approach.goal
            ahead = -goal.rotation[:, 0] if self._backward else goal.rotation[:, 0]
            return np.asarray(goal.position) + _RUN_OUT * ahead
        before, corner = tracker.points_at(np.array([end - _PATH_SPACING, end]))
        return np.asarray(corner + _RUN_OUT / _PATH_SPACING * (corner - before))

    def _pieces_of_a_step(self) -> int:
        """Into how many pieces a step is cut, so that none leads from one side of a thin wall to the other.

        Forbidden is the ground half an edge on both sides of a row of lethal vertices; the row may run where the mesh
        is finest.
        """
        p = self.parameters
        stride = max(p.max_vel_x, -p.min_vel_x) * p.model_dt
        return math.ceil(stride / max(0.5 * self._shortest_edge, _LEAST_STRIDE))

    def _blocked(self) -> BoolArray:
        """Vertices (V,) that no curve may pass near."""
        return np.asarray(self._ranks_at(self.mesh_map.snapshot()) > 0.0)

    def _ranks_at(self, snapshot: MeshSnapshot) -> Float32Array:
        """How forbidden the vertices (V,) are to the robot."""
        wanted = snapshot.version, self.parameters.cost_limit
        if wanted != self._ranks_of:
            self._ranks, self._ranks_of = snapshot.traversability_rank(self.parameters.cost_limit), wanted
        return self._ranks

    def _as_motions(self, controls: FloatArray) -> FloatArray:
        """Turn controls (..., 2) into speed and yaw rate (..., 2), where a car has a steering angle."""
        if self.parameters.motion_model != "ackermann":
            return controls
        yaw_rates = controls[..., 0] * tan(controls[..., 1]) / self.parameters.wheelbase
        return np.stack([controls[..., 0], yaw_rates], axis=-1)

    def _as_command(self, speed: float, turn: float) -> Command:
        if self.parameters.motion_model == "differential":
            return Twist.planar(vx=speed, wz=turn)
        return AckermannCommand(speed, clamp(turn, self._steering_limit))
