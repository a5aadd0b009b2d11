"""Whether any path at all leads a wheeled robot from one place of a terrain to another within its limits.

The judge of an evaluation: it knows the true ground, no map, no cost and no planner, and searches all places and
headings. Where it says no, a failure is the ground's; where it says yes, it is the navigation's. Use it to sort
generated terrains; not for planning, it is coarse (one sample of the terrain, 8 headings) and gives no path.

A robot that stands somewhere with a heading is a state. It is allowed if each axle's roll, each side's pitch, the slope
under each wheel and the ground under the body keep their limits, there and at ``room`` around. States are joined by
driving straight to a neighbour or by turning on the spot, both ways, so what can be reached is a connected component.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mbf_abstract.geometry.arithmetic import arctan
from terrain.physics.robot_models import RobotSpec
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.smoothing import smoothed

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# One step of the grid per heading. Half a circle is enough: all limits are the same forward and backward.
STEPS = ((1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1))


@dataclass(frozen=True)
class DrivingLimits:
    """What a robot can stand on and drive over; angles in degrees, lengths in metres.

    The defaults are of the simulated Husky: measured on even slopes it begins to slide sideways at 30 and climbs 40
    degrees (wheels 45), and its body hangs 0.13 m above the ground, over 0.8 x 0.43 m.

    Attributes
    ----------
    roll, pitch : float
        Greatest of each axle, and of each side; the body's slope in any direction keeps the limit of pitch too.
    turning_tilt : float
        Greatest slope on which it turns on the spot.
    wheel_slope : float
        Greatest slope of a wheel's track, along the heading.
    clearance, body_length, body_width : float
        Of the body above the ground.
    room : float
        All states this far around must be allowed too: controllers do not drive on rails.
    """

    roll: float = 25.0
    pitch: float = 30.0
    turning_tilt: float = 20.0
    wheel_slope: float = 40.0
    clearance: float = 0.12
    body_length: float = 0.8
    body_width: float = 0.43
    room: float = 0.25


def is_reachable(
    terrain: Heightfield,
    spec: RobotSpec,
    start: tuple[float, float, float],
    goal: tuple[float, float],
    tolerance: float = 0.4,
    limits: DrivingLimits | None = None,
) -> bool:
    """Whether a robot with two axles gets from ``start`` (x [m], y [m], yaw [rad]) to within ``tolerance`` of ``goal``.

    Any heading will do at the goal. A start that is not allowed itself reaches nothing.
    """
    allowed, may_turn = allowed_states(terrain, spec, limits or DrivingLimits())
    component = _components(allowed, may_turn)
    ix, iy = round((start[0] - terrain.x0) / terrain.dx), round((start[1] - terrain.y0) / terrain.dy)
    yaws = np.array([_yaw(terrain, step) for step in STEPS])
    heading = int(np.argmax(np.abs(np.cos(yaws - start[2]))))
    if not allowed[heading, iy, ix]:
        return False
    x, y = np.meshgrid(terrain.x0 + terrain.dx * np.arange(terrain.nx), terrain.y0 + terrain.dy * np.arange(terrain.ny))
    at_goal = np.hypot(x - goal[0], y - goal[1]) <= tolerance
    return bool((allowed & at_goal & (component == component[heading, iy, ix])).any())


def allowed_states(terrain: Heightfield, spec: RobotSpec, limits: DrivingLimits) -> tuple[BoolArray, BoolArray]:
    """Return where the robot may stand (8, ny, nx), per heading of ``STEPS``, and where it may also turn."""
    allowed = np.stack([_stands(terrain, spec, _yaw(terrain, step), limits) for step in STEPS])
    reach = np.hypot(*np.meshgrid(*(spacing * np.arange(-8, 9) for spacing in (terrain.dx, terrain.dy))))
    disc = (reach <= limits.room + 1e-9)[None]
    allowed = ndimage.binary_erosion(allowed, disc)
    heights = terrain.heights.astype(np.float64)
    smooth = smoothed(heights, (0.25 * spec.wheelbase / terrain.dy, 0.25 * spec.wheelbase / terrain.dx))
    tilt = np.degrees(arctan(np.hypot(*np.gradient(smooth, terrain.dy, terrain.dx))))
    return allowed, allowed & (tilt <= limits.turning_tilt)


def _yaw(terrain: Heightfield, step: tuple[int, int]) -> float:
    return math.atan2(step[1] * terrain.dy, step[0] * terrain.dx)


def _stands(terrain: Heightfield, spec: RobotSpec, yaw: float, limits: DrivingLimits) -> BoolArray:
    """Where (ny, nx) the robot may stand with a heading; nowhere with a wheel off the terrain."""
    half_base, half_track = 0.5 * spec.wheelbase, 0.5 * spec.track
    front_left, front_right, rear_left, rear_right = (
        _wheel_height(terrain, spec.wheel_radius, yaw, x, y)
        for x in (half_base, -half_base)
        for y in (half_track, -half_track)
    )
    rolls = np.stack([front_left - front_right, rear_left - rear_right]) / spec.track
    pitches = np.stack([front_left - rear_left, front_right - rear_right]) / spec.wheelbase
    ok = np.asarray((np.abs(rolls) <= math.tan(math.radians(limits.roll))).all(axis=0))
    ok &= (np.abs(pitches) <= math.tan(math.radians(limits.pitch))).all(axis=0)
    for x in (half_base, -half_base):
        for y in (half_track, -half_track):
            ahead, behind = (_wheel_height(terrain, spec.wheel_radius, yaw, x + d, y) for d in (0.1, -0.1))
            ok &= np.abs(ahead - behind) <= 0.2 * math.tan(math.radians(limits.wheel_slope))
    pitch, roll = pitches.mean(axis=0), rolls.mean(axis=0)
    ok &= np.hypot(pitch, roll) <= math.tan(math.radians(limits.pitch))
    middle = 0.25 * (front_left + front_right + rear_left + rear_right)
    for x in np.linspace(-0.5, 0.5, 5) * limits.body_length:
        for y in np.linspace(-0.5, 0.5, 3) * limits.body_width:
            ok &= _ground(terrain, yaw, x, y) <= middle + x * pitch + y * roll + limits.clearance
    return ok


def _ground(terrain: Heightfield, yaw: float, forward: float, left: float) -> FloatArray:
    """Height of the ground (ny, nx) at one point of the robot for all its positions; nan off the terrain."""
    x, y = np.meshgrid(terrain.x0 + terrain.dx * np.arange(terrain.nx), terrain.y0 + terrain.dy * np.arange(terrain.ny))
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return terrain.height_at(x + cosine * forward - sine * left, y + sine * forward + cosine * left)


def _wheel_height(terrain: Heightfield, radius: float, yaw: float, forward: float, left: float) -> FloatArray:
    """Height (ny, nx) of the lowest point of a round wheel that rests on the ground with any part of its outline."""
    along = np.linspace(-0.9, 0.9, 7) * radius
    heights = [_ground(terrain, yaw, forward + d, left) + math.sqrt(radius**2 - d**2) - radius for d in along.tolist()]
    return np.asarray(np.max(heights, axis=0))


def _components(allowed: BoolArray, may_turn: BoolArray) -> NDArray[np.int32]:
    """Label (8, ny, nx) of the component each state belongs to."""
    number = np.arange(allowed.size).reshape(allowed.shape)
    joined: list[tuple[NDArray[np.intp], NDArray[np.intp]]] = []
    for heading, (dx, dy) in enumerate(STEPS):
        here, there = _shifted(number[heading], dx, dy)
        both = allowed.ravel()[here] & allowed.ravel()[there]
        joined.append((here[both], there[both]))
        turned = (heading + 1) % len(STEPS)
        both = may_turn[heading] & may_turn[turned]
        joined.append((number[heading][both], number[turned][both]))
    starts, ends = (np.concatenate(column) for column in zip(*joined, strict=True))
    graph = coo_array((np.ones(len(starts), np.int8), (starts, ends)), (allowed.size, allowed.size))
    return np.asarray(connected_components(graph, directed=False)[1]).reshape(allowed.shape)


def _shifted(numbers: NDArray[np.intp], dx: int, dy: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Each state with the one ``dx`` columns and ``dy`` >= 0 rows on, as flat arrays."""
    ny, nx = numbers.shape
    here = numbers[: ny - dy, max(0, -dx) : nx - max(0, dx)]
    there = numbers[dy:, max(0, dx) : nx + min(0, dx)]
    return here.ravel(), there.ravel()
