"""Steering a car closely along its path: the best of many short sequences of arcs, none of which touches anything.

When to use: cars on paths of a planner that knows their turning circle. An arc to a point on the path knows neither the
heading that the car will have there nor that it can steer back only so fast; along a path as tight as the car can steer
it ends beside it, or with another heading, and no single arc leads on. When not: robots that turn on the spot, cars far
from their path, and fast ones: the samples end ``FARTHEST`` ahead.

Rule: all sequences of arcs over ``PIECES`` with ``STEERINGS`` of the tightest curve are driven in thought. The best one
keeps the outline nearest to where it would be on the path: the squares of how far the base, and the end of the outline
that leads, are beside there, at the end of each arc, and a little for every turn of the steering. An end that trails
would be turned onto the path at once, and lead the car away from it, see ``_reach``. It is driven for one cycle.
Cost: 0.1 to 0.3 ms a cycle; 2 ms for a bus of 12 m on cells of 0.1 m.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.maps.controllers.room_to_turn import LOOKS_ALONG
from mbf_costmap_nav.control.path_handling import ControlCycle
from mbf_costmap_nav.control.regulated_speed import RegulatedPurePursuitParameters
from mbf_costmap_nav.kernels.control.steering import best_sequence

PIECES = np.array([3.0, 5.0, 7.0]) / 35.0
"""Lengths of the arcs of a sequence, in radii of the tightest curve; longer at speed, shorter before a cusp."""
STEERINGS = np.array([0.0, -1.0, 1.0, -0.5, 0.5, -0.2, 0.2])
"""Shares of the curvature of the tightest curve; of equally good ones the earlier counts."""
SLIGHT = float(np.abs(STEERINGS[STEERINGS != 0.0]).min())
"""The least of these shares that steers."""
STEERING_COST = 1e-5
"""[m^2] What turning the steering from straight on to the tightest curve costs."""
NOTHING_LEFT = 1e-3
"""[m] So near before a cusp there is nothing to steer."""
FAR_OFF = 0.2
"""[m] Farther from its path a car is not steered closely, but back to the path; more on large turning circles."""
ASTRAY = 0.1
"""[m] A sequence that ends farther beside the path than this, and than the car is, does not follow it; likewise."""
LEAST_LEAD = 0.3
"""Of what leads, in radii of the tightest curve."""
FARTHEST = 1.0
"""[m] Cars that have to look farther ahead are too fast; likewise."""
NO_SAMPLES = np.zeros((0, 2))


def steer_closely(
    cycle: ControlCycle,
    radius: float,
    speed: float,
    parameters: RegulatedPurePursuitParameters,
    *,
    is_tight: bool = False,
) -> float | None:
    """Change of heading per length [rad/m] that begins the best sequence; None where none follows the path freely.

    Parameters
    ----------
    radius : float
        Of the car's tightest curve [m].
    speed : float
        That will be driven [m/s]; one against the direction of the path is that of a car which still has to stop.
    is_tight : bool
        Whether the place is, see ``tight_places``.
    """
    tracker, pose, velocity = cycle.tracker, cycle.request.pose, cycle.request.velocity
    ahead = max(abs(speed) * parameters.check_ahead_time, parameters.min_distance_to_obstacle) / cycle.limit_factor
    direction = -1.0 if tracker.driving_backward else 1.0
    size = max(1.0, radius)
    is_far = max(tracker.deviation / FAR_OFF, ahead / FARTHEST) > size
    if is_far or len(tracker.path) < 2 or direction * speed <= 0.0:
        return None
    pieces = radius * PIECES
    whole = float(np.add.reduce(pieces))
    scale = min(max(1.0, ahead / whole), tracker.to_cusp / whole)
    wanted = np.array([_pose_ahead(tracker, at) for at in (scale * np.add.accumulate(pieces)).tolist()])
    if scale * whole < NOTHING_LEFT or not _looks_along(wanted, direction):
        return None
    reach, resolution = _reach(cycle, direction, radius, is_tight=is_tight), cycle.costmap.resolution
    now = velocity.wz / abs(velocity.vx) if velocity.vx != 0.0 else 0.0
    curvature, beside = best_sequence(
        cycle.costmap.cells,
        np.array([resolution, cycle.costmap.origin_x, cycle.costmap.origin_y]),
        cycle.footprint.samples if parameters.collision_check else NO_SAMPLES,
        np.array([pose.x, pose.y, pose.yaw]),
        wanted,
        direction * scale * pieces,
        STEERINGS / radius,
        min(max(now, -1.0 / radius), 1.0 / radius),
        STEERING_COST * radius**2,
        reach,
        0.5 * resolution / (1.0 + _farthest(cycle) / radius),  # half a cell of the outline from pose to pose
        speed * parameters.period,
    )
    return None if beside > max(_beside(tracker, pose, reach), 2.0 * (ASTRAY * size) ** 2) else float(curvature)


def _looks_along(wanted: FloatArray, direction: float) -> bool:
    """Whether poses (n, 3) of a path look along it, or against it where it is driven backward; not all planners' do."""
    dx, dy = (direction * (wanted[-1, :2] - wanted[0, :2])).tolist()
    return abs(math.remainder(math.atan2(dy, dx) - float(wanted[0, 2]), 2.0 * math.pi)) <= LOOKS_ALONG


def _reach(cycle: ControlCycle, direction: float, radius: float, *, is_tight: bool) -> float:
    """How far [m] before the base the end is that is kept to the path, negative where that is behind.

    It is the one that leads, ``LEAST_LEAD`` radii of the tightest curve away at least: of a short end the car would
    learn too late. In the short strokes in reverse of a tight place the nose hits something first, if it is farther.
    """
    along = direction * cycle.footprint.footprint.vertices[:, 0]
    leads, trails = float(along.max(initial=0.0)), float(-along.min(initial=0.0))
    if is_tight and direction < 0.0 and trails > leads:
        return trails
    return direction * max(leads, LEAST_LEAD * radius)


def _farthest(cycle: ControlCycle) -> float:
    """How far [m] the outline's farthest end is from the base, along it."""
    return float(np.abs(cycle.footprint.footprint.vertices[:, 0]).max(initial=0.0))


def _beside(tracker: PathTracker, pose: Pose, reach: float) -> float:
    """Squares [m^2] of how far base and farthest end are beside where they would be on the path."""
    x, y, yaw = _pose_ahead(tracker, 0.0)
    side = (pose.y - y) * math.cos(yaw) - (pose.x - x) * math.sin(yaw)
    return side**2 + (side + reach * math.remainder(pose.yaw - yaw, 2.0 * math.pi)) ** 2


def _pose_ahead(tracker: PathTracker, distance: float) -> tuple[float, float, float]:
    """Pose so far [m] ahead on the path, at most at the next cusp, with the heading between those of its poses."""
    length, lengths = min(tracker.progress + distance, tracker.next_cusp), tracker.lengths
    x, y = tracker.point_at(length)[:2].tolist()
    after = min(max(int(lengths.searchsorted(length)), 1), len(lengths) - 1)
    (begin, end), poses = lengths[after - 1 : after + 1].tolist(), tracker.path
    yaw = poses[after - 1].yaw
    share = (length - begin) / (end - begin) if end > begin else 1.0
    return x, y, yaw + share * math.remainder(poses[after].yaw - yaw, 2.0 * math.pi)
