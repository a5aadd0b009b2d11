"""What the critics of ``mesh.mppi`` look at of the path: the part of it that motions can reach."""

from __future__ import annotations

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Pose
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.kernels.motion.mppi import PathAhead
from mbf_mesh_nav.motion.sampled_motions import MPPIParameters

_SPACING = 0.1  # [m] between the samples
_RUN_OUT = np.array([[0.1], [0.2], [0.3]])  # [m] beyond the end of a section that a car drives


def path_ahead(tracker: PathTracker, p: MPPIParameters, goal: Pose, *, reverses: bool) -> PathAhead:
    """Sample the path from where the robot is on it; ``reverses`` if sections of it are driven in reverse."""
    backward = reverses and tracker.driving_backward
    reach = p.max_vel_x * p.time_steps * p.model_dt + 1.0
    end = min(tracker.progress + reach, tracker.next_cusp)
    along = np.append(np.arange(tracker.progress, end, _SPACING), end)
    ahead, remaining = tracker.points_at(along), tracker.next_cusp - along
    if p.motion_model == "ackermann" and (end == tracker.length or (reverses and end == tracker.next_cusp)):
        # Beyond the end, for the critic that looks along the path: it shows how to stand there. A cusp draws the
        # car past itself, or it would creep to it.
        ahead = np.concatenate([ahead, _run_out(tracker, end, goal, backward)])
        beyond = np.zeros(len(_RUN_OUT)) if end == tracker.length else -_RUN_OUT[:, 0]
        remaining = np.append(remaining, beyond)
    return PathAhead(ahead, remaining, -1.0 if backward else 1.0)


def _run_out(tracker: PathTracker, end: float, goal: Pose, backward: bool) -> FloatArray:
    """Points (3, 3) straight on beyond ``end`` [m] of the path: beyond a cusp, or beyond the goal as it looks."""
    if end == tracker.length:
        ahead = -goal.rotation[:, 0] if backward else goal.rotation[:, 0]
        return np.asarray(goal.position) + _RUN_OUT * ahead
    before, corner = tracker.points_at(np.array([end - _SPACING, end]))
    return np.asarray(corner + _RUN_OUT / _SPACING * (corner - before))
