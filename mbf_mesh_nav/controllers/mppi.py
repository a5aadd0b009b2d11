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
from typing import Any

import numpy as np

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arithmetic import exp, norm
from mbf_abstract.geometry.polyline import reverse_segments
from mbf_abstract.geometry.tangent_plane import ground_distance, heading_error
from mbf_abstract.maps.controllers.failures import missed_path, no_motion
from mbf_abstract.maps.controllers.inertia import PLANNED, stopping_speed
from mbf_abstract.maps.tracking.avoidance import Encounters, MovingAround
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, ControlResult, PlannedMotion
from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray
from mbf_mesh_nav.kernels.mesh.surface_walk import tangent
from mbf_mesh_nav.kernels.motion.mppi import SurfacePose, score_rollouts
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.positions import position_text, vector_of
from mbf_mesh_nav.motion.goal_approach import GoalApproach, clamp, tracker_on_surface
from mbf_mesh_nav.motion.path_ahead import path_ahead
from mbf_mesh_nav.motion.sampled_motions import MPPIParameters, SampledMotions, critics, pieces_of_a_step
from mbf_mesh_nav.motion.surface_follower import KeepingFollower
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.search.final_approach import with_final_approach, with_first_turn

_COLLISION_SCORE = 1e6
_ROOM_TO_STEER = 1.2  # radius of the approach to the goal, in least turning radii
_STRICT_RADII = 8.0  # before the goal at which a bent approach begins to be followed ...
_STRICTNESS = 10.0  # ... so many times more closely: a car that cuts it arrives with the wrong heading
_STANDSTILL = 0.2  # [m] and [rad] gained over the horizon: less than this is no motion
_IDLE_CYCLES = 20  # without motion, after which there is none that gets on


class MPPIController(KeepingFollower):
    """Sampling controller that avoids what the map shows now."""

    Parameters = MPPIParameters
    parameters: MPPIParameters

    _hindered_by = ""

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._shortest_edge = float(self.mesh_map.neighbour_lengths.min())
        self._ranks_of: tuple[int, float] = (-1, 0.0)  # version of the map and cost limit
        self._ranks: Float32Array = np.zeros(0, dtype=np.float32)

    def parameters_changed(self) -> None:
        """Take over new limits."""
        p = self.parameters
        horizon = p.model_dt * p.time_steps if p.acc_lim_x < math.inf else math.inf
        self._keeping.drive_with(p.max_vel_x, p.max_vel_theta, p, p, allow_reversing=p.min_vel_x < 0.0, horizon=horizon)

    @classmethod
    def reach(cls, parameters: MPPIParameters) -> float:
        """To the end of the longest motion it tries, from a robot beside the surface."""
        speed = max(parameters.max_vel_x, -parameters.min_vel_x)
        return speed * parameters.time_steps * parameters.model_dt + parameters.max_surface_distance

    def set_plan(self, path: Path) -> bool:
        """Take over a path of at least one pose in the map's frame; not one in reverse for a car that may not."""
        if why := self.not_on_mesh(path):
            return self.refuse(why)
        p, is_car = self.parameters, self.parameters.motion_model == "ackermann"
        self._reverses = is_car and bool(reverse_segments(path, path.positions).any())
        if self._reverses and p.min_vel_x == 0.0:
            return self.refuse("it is driven in reverse in part, which min_vel_x: 0 forbids")
        self._approach = GoalApproach(path[-1], p.goal_distance)
        self._strict_below = 0.0
        if is_car and not self._reverses:
            bent = with_final_approach(
                path, self.mesh_map, self._blocked(), _ROOM_TO_STEER * self._motions.turning_radius
            )
            self._strict_below = _STRICT_RADII * self._motions.turning_radius if bent is not path else 0.0
            path = bent
        self._begun, self._idle_cycles = False, 0
        self._follow(path)
        self._keeping.set_plan(path)
        self._nominal: FloatArray = np.zeros((p.time_steps, 2))
        return True

    @property
    def turns_on_the_spot(self) -> bool:
        """Whether its motion model can turn on the spot."""
        return self.parameters.motion_model == "differential"

    @property
    def _motions(self) -> SampledMotions:
        """The motions to try, by the parameters of now."""
        return SampledMotions(self.parameters, self.min_turning_radius)

    def _follow(self, path: Path) -> None:
        self._tracker = tracker_on_surface(self.mesh_map, path, self.parameters.max_surface_distance)

    def _begin(self, spot: SurfacePoint, pose: Pose) -> None:
        """Prepend a curve that leads a car of another heading onto its path, now that its pose is known."""
        p, path = self.parameters, self._tracker.path
        self._begun = True
        if p.motion_model == "ackermann" and not self._reverses:
            radius = _ROOM_TO_STEER * self._motions.turning_radius
            self._tracker.update(spot.point)
            ahead = Path.from_points(self._tracker.ahead(math.inf), path[-1].orientation, None, path.frame_id)
            bent = with_first_turn(ahead, self.mesh_map, self._blocked(), radius, pose)
            if bent is not ahead:
                self._follow(bent)

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """One cycle: locate, then sample, or keep to the path."""
        p, pose = self.parameters, request.pose
        cycle = self.begin_cycle(pose, p.max_surface_distance)
        if isinstance(cycle, ControlResult):
            return cycle
        spot, approach = cycle
        if not self._begun:
            self._begin(spot, pose)
        self._tracker.update(spot.point)
        missed = missed_path(self._tracker, p.max_path_distance * self.limit_factor)
        if missed and not self._keeping.is_leaving:
            return missed
        if approach.is_only_turning(pose, self._tracker):
            return self._turn_at_goal(request, approach)
        around, limits = MovingAround.on(self.mesh_map, pose, self.clock.now(), p.moving_objects), self._motions.limits
        return self._keeping.choose(request, limits, p.standing, around, lambda: self._sampled(spot, request, around))

    def _turn_at_goal(self, request: ControlRequest, approach: GoalApproach) -> ControlResult:
        """Turn to the goal's heading, which a car cannot do."""
        p, off = self.parameters, heading_error(request.pose, approach.goal)
        self._idle_cycles += p.motion_model == "ackermann"
        if self._idle_cycles > _IDLE_CYCLES:
            message = f"the goal is reached but for {off:.2f} rad of heading, which a car cannot correct there"
            return ControlResult(ExePathOutcome.NO_VALID_CMD, message)
        turn = p.turn_rate(clamp(2.0 * off, p.max_vel_theta), off)
        command = p.reachable(Twist.planar(wz=turn), request.velocity) if self.turns_on_the_spot else Twist()
        return ControlResult(ExePathOutcome.SUCCESS, "", self._motions.command(command.vx, command.wz))

    def _sampled(self, spot: SurfacePoint, request: ControlRequest, around: MovingAround) -> ControlResult:
        """Sample around the last motion, score, blend, check."""
        motion = self._best_motion(spot, request, around)
        if motion is None:
            text = f"no motion sampled at {position_text(spot.point)} is collision-free and makes progress"
            return no_motion(self.mesh_map, request.pose, text)
        self._nominal = np.concatenate([motion[1:], motion[-1:]])
        command = self._motions.command(float(motion[0, 0]), float(motion[0, 1]))
        return ControlResult(ExePathOutcome.SUCCESS, "", command, self._hindered_by)

    def planned_motion(self) -> PlannedMotion | None:
        """Return the last motion, without its first step; None where it keeps to the path instead."""
        if self._approach is None or self._keeping.is_keeping:
            return None
        speed, yaw_rate = np.moveaxis(self._motions.driven(self._nominal), -1, 0)
        return PlannedMotion(np.stack([speed, np.zeros_like(speed), yaw_rate], axis=1), self.parameters.model_dt)

    def _best_motion(self, spot: SurfacePoint, request: ControlRequest, around: MovingAround) -> FloatArray | None:
        """Blend the sampled motions by their scores; (time_steps, 2), or None if no motion makes progress."""
        p, pose, now = self.parameters, request.pose, request.velocity
        braking = min(p.decel_lim_x, PLANNED * p.acc_lim_x)
        max_speed = min(p.max_vel_x, max(stopping_speed(self._tracker.to_cusp, braking, p.reaction_time), 0.1))
        # A robot beside its goal or past it has no path ahead of it, but still a distance to drive.
        end = self._tracker.point_at(self._tracker.next_cusp)
        to_end = float(norm(end - spot.point))
        room = max(self._tracker.to_cusp, to_end)
        controls = self._motions.sampled(self.rng, self._nominal, max_speed, room, now, reverses=self._reverses)
        scores, collided, met = self._score(controls, spot, pose, around)
        scores = np.where(collided, scores + _COLLISION_SCORE, scores)
        self._hindered_by = around.hindering(met, scores)
        scores = scores + met.costs
        weights = exp(-(scores - scores.min()) / self.parameters.temperature)
        blended = np.asarray(((weights / weights.sum())[:, None, None] * controls).sum(axis=0))
        # The mean of two free motions, left and right of an obstacle or of somebody, may hit it.
        best = int(np.argmin(scores))
        _, hits, mean_met = self._score(blended[None], spot, pose, around)
        spoiled = hits[0] or (mean_met.touches[0] and not met.touches[best])
        if spoiled or not self._stops_free(blended[0], spot, pose, around):
            blended = np.asarray(controls[best])
        if not self._stops_free(blended[0], spot, pose, around):
            return None
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
        assert self._approach is not None
        has_far_to_go = ground_distance(pose, self._approach.goal) > _STANDSTILL + self.parameters.goal_distance
        self._idle_cycles = self._idle_cycles + 1 if stands and has_far_to_go else 0
        stuck = stands and (collided.mean() > 0.5 or self._idle_cycles > _IDLE_CYCLES)
        touches = self.outline_on(pose, Twist.planar(float(blended[0, 0]), wz=float(blended[0, 1])))
        return None if stuck or touches or bool(collided.all()) else blended

    def _stops_free(self, control: FloatArray, *there: Any) -> bool:
        """Whether the robot touches nothing until it stands if it is stopped after a step with a control (2,)."""
        braked = self._motions.braked(control)
        return braked is None or not self._score(braked[None], *there)[1][0]

    def _score(
        self, controls: FloatArray, spot: SurfacePoint, pose: Pose, around: MovingAround
    ) -> tuple[FloatArray, BoolArray, Encounters]:
        """Scores (n,) of motions, collisions (n,) on the map of now, and what moves that they meet."""
        assert self._approach is not None
        p, mesh_map = self.parameters, self.mesh_map
        snapshot = mesh_map.snapshot()
        pieces = pieces_of_a_step(p, self._shortest_edge)
        motions = np.repeat(self._motions.driven(controls), pieces, axis=1)
        heading = tangent(vector_of(pose.rotation[:, 0]), vector_of(mesh_map.face_normals[spot.face]))
        poses = np.empty((3, motions.shape[1] if around.anybody else 0, len(motions)), dtype=np.float32)
        scores, collided = score_rollouts(
            mesh_map.topology.surface,
            snapshot.costs,
            self._ranks_at(snapshot),
            SurfacePose(spot.face, vector_of(spot.point), heading),
            motions,
            p.model_dt / pieces,
            path_ahead(self._tracker, p, self._approach.goal, reverses=self._reverses),
            critics(p, _STRICTNESS if self._tracker.remaining < self._strict_below else 1.0),
            poses,
        )
        return scores, collided, around.meet(poses, p.model_dt / pieces)

    def _blocked(self) -> BoolArray:
        """Vertices (V,) that no curve may pass near."""
        return np.asarray(self._ranks_at(self.mesh_map.snapshot()) > 0.0)

    def _ranks_at(self, snapshot: MeshSnapshot) -> Float32Array:
        """How forbidden the vertices (V,) are to the robot."""
        wanted = snapshot.version, self.parameters.cost_limit
        if wanted != self._ranks_of:
            self._ranks, self._ranks_of = snapshot.traversability_rank(self.parameters.cost_limit), wanted
        return self._ranks
