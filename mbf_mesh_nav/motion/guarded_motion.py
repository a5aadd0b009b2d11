"""What recoveries that move the robot share: one loop with all ways out, and a look at the ground ahead.

The loop polls the cancel token, keeps a time limit, hands each fresh pose to a step function and sends what it
answers; whatever happens the last command is zero.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_abstract.time.clock import Clock
from mbf_mesh_nav.kernels.mesh.surface_walk import tangent, walk
from mbf_mesh_nav.kernels.search.forbidden_surface import hardness_at, may_enter
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.locate import SurfacePoint

CONTROL_PERIOD = 0.05
"""Seconds between two commands."""


Behavior = TypeVar("Behavior")
Run = Callable[[Behavior, RecoveryRequest], RecoveryResult]


def reports_lost_pose(run_behavior: Run[Behavior]) -> Run[Behavior]:
    """Decorate ``run_behavior``: a robot whose pose is lost is a TF_ERROR, not an exception."""

    @wraps(run_behavior)
    def guarded(self: Behavior, request: RecoveryRequest) -> RecoveryResult:
        try:
            return run_behavior(self, request)
        except RobotStateError as error:
            return RecoveryResult(RecoveryOutcome.TF_ERROR, str(error))

    return guarded


def run_guarded(
    request: RecoveryRequest, clock: Clock, time_limit: float, step: Callable[[Pose], Twist | RecoveryResult]
) -> RecoveryResult:
    """Drive by ``step`` until it answers a result, the goal is cancelled, or ``time_limit`` [s] is over."""
    motion, token = request.motion, request.cancel_token
    deadline = clock.now() + time_limit
    try:
        while not token.cancelled:
            if clock.now() > deadline:
                return RecoveryResult(RecoveryOutcome.PAT_EXCEEDED, f"not finished within {time_limit:g} s")
            answer = step(motion.pose())
            if isinstance(answer, RecoveryResult):
                return answer
            if not motion.send(answer):
                return RecoveryResult(RecoveryOutcome.STOPPED, "the velocity gate refused the command")
            if not motion.sleep(CONTROL_PERIOD) and not token.cancelled:
                return RecoveryResult(RecoveryOutcome.STOPPED, "the behaviour was told to end")
        return RecoveryResult(RecoveryOutcome.CANCELED, token.reason)
    finally:
        motion.send(Twist())


def free_distance(
    mesh_map: MeshMap,
    hardness: NDArray[np.float32],
    spot: SurfacePoint,
    direction: NDArray[np.float64],
    distance: float,
    stride: float = 0.05,
) -> float:
    """How far [m], up to ``distance``, the ground is free straight ahead of a surface point.

    Borders end it, and forbidden ground, ``hardness`` (V,); where the robot stands on such ground itself it may leave
    it, see ``kernels.forbidden_ground``.
    """
    face = spot.face
    x, y, z = spot.point
    normal = mesh_map.face_normals[face]
    point = (float(x), float(y), float(z))
    way = tangent((float(direction[0]), float(direction[1]), float(direction[2])), tuple(normal.tolist()))
    stands_on = hardness_at(mesh_map.vertices, mesh_map.faces, hardness, face, point)
    travelled = 0.0
    while travelled < distance:
        face, point, way, walked = walk(
            mesh_map.vertices,
            mesh_map.faces,
            mesh_map.face_neighbours,
            mesh_map.face_normals,
            face,
            point,
            way,
            min(stride, distance - travelled),
        )
        comes_to = hardness_at(mesh_map.vertices, mesh_map.faces, hardness, face, point)
        if not may_enter(stands_on, comes_to):
            break
        stands_on = comes_to
        travelled += walked
        if walked < 1e-6:
            break
    return travelled
