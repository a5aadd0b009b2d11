"""Where moving objects will be, and what that costs plans and samplers.

A prediction costs something in a disc around the place where an object will be, as large as the object and the robot's
inscribed circle. The cost falls linearly with the time until then, from ``prediction_cost`` now to nothing at
``prediction_time``. Where the object is now the obstacle layers mark what is seen; a prediction is never lethal,
because it may be wrong.

One that is passed costs for ``passing_time``, as it takes that long to get past, and as far beside it as the robot
keeps so as not to be stopped there (``contact.py``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.maps.tracking.contact_parameters import ContactParameters
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.parameters import parameter

PREDICTION_STEP = 0.1
"""Longest time [s] between two predicted places."""
LEAST_RADIUS = 0.05
"""Predicted places of smaller objects [m] are as far apart as those of such a one."""
ROOM = 0.1
"""So much farther [m] from an object than it must a path leads, as its place, cells and the drive are not exact."""
APPROACH = 5.0
"""A robot that is farther away than it drives in this time [s] has not begun to pass: plans would lead now left, now
right of an object that is far."""
STILL_PASSING = 1.0
"""A robot that is farther [m] ahead of an object, the way that this one goes, has passed it."""
NOWHERE: FloatArray = np.full(3, math.nan)
"""[m]; behind nothing and beside nothing."""
SLOW = 0.8
"""Who is faster than this share of the robot's speed is followed, as to pass them takes too long."""


class PredictionParameters(ContactParameters):
    """How long, and how much, the places of moving objects cost."""

    prediction_time: float = parameter(
        2.0, "How far ahead the places of moving objects cost something; 0 = no costs.", unit="s", ge=0.0, le=20.0
    )
    passing_time: float = parameter(
        6.0,
        "The same for one that the robot comes from behind and can pass, which takes longer; 0 = as for all others.",
        unit="s",
        ge=0.0,
        le=20.0,
    )
    max_vel_x: float = parameter(
        0.5, "Greatest speed of the robot; it passes who goes at up to 0.8 of that.", unit="m/s", ge=0.0, le=100.0
    )
    prediction_cost: float = parameter(
        0.8, "Cost of the place where a moving object is now, as a share of that of an obstacle.", ge=0.0, lt=1.0
    )


class Prediction(NamedTuple):
    """Where an object will be: ``middles`` (n, 3) [m] in order of time, the radius [m] around each, and costs (n,)."""

    middles: FloatArray
    radius: float
    costs: FloatArray


def predict(
    known: TrackedObject,
    parameters: PredictionParameters,
    inscribed_radius: float,
    sensor: FloatArray,
    robot: Pose | None = None,
) -> Prediction:
    """Where an object will be, and what that costs a robot of this radius [m] with a ``sensor`` (3,) [m].

    The middles are at most an object's radius apart; there are none of an object that does not move. The costs fall
    from ``prediction_cost`` at the first one towards 0 at the end of the time. Who comes from behind a ``robot`` whose
    heading is known costs up to there: it would have to be slow in costs that are of somebody who follows it.
    """
    p = parameters
    time, radius = p.prediction_time, known.radius + inscribed_radius
    if p.passing_time > 0.0 and _is_passed(known, p, sensor):
        time, radius = max(time, p.passing_time), radius + _kept_distance(known, p)
    if known.motion is not Motion.MOVING or p.prediction_time == 0.0:
        return Prediction(np.zeros((0, 3)), radius, np.zeros(0))
    steps = math.ceil(time / min(PREDICTION_STEP, max(known.radius, LEAST_RADIUS) / max(known.speed, 1e-6)))
    shares = np.arange(steps) / steps
    middles = np.empty((steps, 3))
    middles[:, 0], middles[:, 1] = known.position_in(shares * time)
    middles[:, 2] = known.z
    costs = p.prediction_cost * (1.0 - shares)
    if robot is not None and _is_behind(known, robot):
        there = np.hypot(middles[:, 0] - robot.x, middles[:, 1] - robot.y) <= radius
        end = int(np.argmax(there)) if there.any() else steps
        middles, costs = middles[:end], costs[:end]
    return Prediction(middles, radius, costs)


def _is_behind(known: TrackedObject, robot: Pose) -> bool:
    return (known.x - robot.x) * math.cos(robot.yaw) + (known.y - robot.y) * math.sin(robot.yaw) < 0.0


def _kept_distance(known: TrackedObject, parameters: PredictionParameters) -> float:
    """How far [m] beside a moving object the robot drives without being stopped: as if that one turned now."""
    p = parameters
    return p.contact_margin + p.turning_time * known.speed + ROOM if p.stop_before_contact else 0.0


def _is_passed(known: TrackedObject, parameters: PredictionParameters, sensor: FloatArray) -> bool:
    """Whether a moving object is slow, and the robot near behind or beside it, seen the way that it goes."""
    fastest = parameters.max_vel_x
    dx, dy = (sensor[:2] - (known.x, known.y)).tolist()
    ahead = dx * known.vx + dy * known.vy
    is_near = math.hypot(dx, dy) < APPROACH * fastest
    return is_near and ahead <= STILL_PASSING * known.speed and known.speed <= SLOW * fastest
