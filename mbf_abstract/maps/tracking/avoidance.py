"""How a sampling controller prefers motions that meet nobody: going around, letting by, slowing down early.

When to use: in every controller that samples motions, on both maps, beside its other terms. When not: as the only
protection: a cost can be outweighed, and objects change their velocities. ``contact.py`` stops the robot in time.

A motion is charged for what it makes worse than staying where the robot is. So a robot that stands is never at fault,
whoever comes, and one that gets out of the way is not either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.tracking.contact import in_the_way, moving_on_storey
from mbf_abstract.maps.tracking.kernels.meeting import NOBODY, OBJECT_COLUMNS, meet
from mbf_abstract.maps.tracking.objects import TrackedObject
from mbf_abstract.parameters import ParameterModel, parameter

Float32Array = NDArray[np.float32]

LOOK = 0.1
"""Time [s] between two looks at robot and objects, or one step of the motions if that is longer.

With steps of half a second who crosses at 1.5 m/s moves by 0.75 m between two looks, and may pass a motion unseen. Only
the guard of ``contact.py`` sees it then.
"""


NO_OBJECTS: Float32Array = np.empty((0, OBJECT_COLUMNS), dtype=np.float32)
NO_OUTLINE: Float32Array = np.zeros(5, dtype=np.float32)


class AvoidanceParameters(ParameterModel):
    """How sampled motions keep away from where moving objects will be."""

    weight: float = parameter(
        20.0, "Cost of touching a moving object at once; falls to 0 at the horizon. 0 switches it off.", ge=0.0, le=1e4
    )
    horizon: float = parameter(2.5, "What would be met later costs nothing.", unit="s", gt=0.0, le=20.0)
    margin: float = parameter(
        0.3, "From here on a motion costs something, the more the nearer to contact.", unit="m", gt=0.0, le=5.0
    )


class Encounters(NamedTuple):
    """What motions (n,) meet.

    Attributes
    ----------
    costs : (n,) float32
    touched : (n,) int32
        Whom each leads into first who would not touch a robot that stays, among ``MovingAround.moving``, or NOBODY.
    touches : (n,) bool
        Whether each leads into somebody.
    """

    costs: Float32Array
    touched: NDArray[np.int32]
    touches: NDArray[np.bool_]


@dataclass(frozen=True)
class MovingAround:
    """The objects that move around the robot in one control cycle.

    Attributes
    ----------
    objects : (k, 5) float32
        Place [m] relative to the robot, velocity [m/s] and radius [m] of each, along the axes of the map.
    yaw : float
        Of the robot [rad].
    box : (5,) float32
        Its outline, a ``RobotBox``.
    """

    moving: Sequence[TrackedObject]
    objects: Float32Array
    yaw: float
    box: Float32Array
    limits: AvoidanceParameters

    @classmethod
    def on(cls, navigation_map: NavigationMap, pose: Pose, now: float, limits: AvoidanceParameters) -> MovingAround:
        """What moves on the map at ``now`` [s]; nothing where the weight is 0.

        Parameters
        ----------
        navigation_map : NavigationMap
            The one the controller works on.
        pose : Pose
            Of the robot, in the frame of the map.
        """
        known = navigation_map.tracked_objects(now) if limits.weight > 0.0 else ()
        moving = moving_on_storey(known, pose.z, navigation_map.same_storey)
        if not moving:
            return cls((), NO_OBJECTS, pose.yaw, NO_OUTLINE, limits)
        rows = [(one.x - pose.x, one.y - pose.y, one.vx, one.vy, one.radius) for one in moving]
        objects = np.array(rows, dtype=np.float32).reshape(-1, OBJECT_COLUMNS)
        return cls(moving, objects, pose.yaw, np.array(navigation_map.robot_box, dtype=np.float32), limits)

    @property
    def anybody(self) -> bool:
        """Whether anything moves; if not, no motion meets anybody, and poses are not looked at."""
        return len(self.objects) > 0

    def meet(self, poses: Float32Array, step_time: float) -> Encounters:
        """What motions meet. Where nobody moves the answer is kept, and not to be written to.

        Parameters
        ----------
        poses : (3, steps, n) float32
            x, y [m] relative to the robot, axes of the map, and yaw [rad] after each step.
        step_time : float
            Length of a step [s].
        """
        if not self.anybody:
            return _nobody(poses.shape[2])
        p = self.limits
        stride = max(1, round(LOOK / step_time))
        costs, touched = meet(poses, self.yaw, step_time, stride, self.box, self.objects, p.horizon, p.margin)
        return Encounters(np.float32(p.weight) * costs, touched, touched != NOBODY)

    def nearest(self, within: float) -> str:
        """Whom a robot that cannot get on waits for: the nearest, if nearer than ``within`` [m]; empty if nobody."""
        gaps = norm(self.objects[:, :2]) - self.objects[:, 4]
        return in_the_way(self.moving[int(np.argmin(gaps))]) if len(gaps) and gaps.min() < within else ""

    def hindering(self, met: Encounters, costs: FloatArray | Float32Array) -> str:
        """Whom the robot would drive into if it did not look ahead; empty if nobody.

        Parameters
        ----------
        met : Encounters
            Of its motions.
        costs : (n,) float
            Of these motions, without those of ``met``.
        """
        if not self.anybody:
            return ""
        touched = int(met.touched[int(np.argmin(costs))])
        return "" if touched == NOBODY else in_the_way(self.moving[touched])


@lru_cache(maxsize=8)
def _nobody(samples: int) -> Encounters:
    """What so many motions meet where nobody moves.

    The kernel is called for it once, so that it is not compiled while the robot drives towards the first one who does.
    """
    poses = np.empty((3, 0, samples), dtype=np.float32)
    costs, touched = meet(poses, 0.0, LOOK, 1, NO_OUTLINE, NO_OBJECTS, 1.0, 1.0)
    answer = Encounters(costs, touched, touched != NOBODY)
    for array in answer:
        array.flags.writeable = False
    return answer
