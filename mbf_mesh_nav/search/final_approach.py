"""The first and last stretch of a path for a robot that cannot turn on the spot: a car leaves and arrives on curves.

Where the path arrives otherwise than along the goal's heading, its end is replaced by the shortest curve of two arcs
and a line between (Dubins 1957; the lengths after Shkel and Lumelsky, "Classification of the Dubins set", 2001), laid
out in the goal's tangent plane and put onto the surface. Its begin is treated likewise, seen from the other end.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, quaternion_from_yaw, quaternion_multiply
from mbf_abstract.geometry.arithmetic import norm, rotated, rotated_back, scalar_products
from mbf_mesh_nav.arrays import BoolArray, FloatArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.borders import beyond_border
from mbf_mesh_nav.mesh.locate import Location

_SMALL_CORNER = 0.2  # [rad] between the path's end and the goal's heading: driven without an approach
_SMALL_TURN = 1.2  # [rad] between the robot's heading and the path's begin: steered into without a curve
_LEAVING = (1.0, 2.0, 3.0, 4.0, 6.0)  # turning radii before the goal at which the curve may leave the path
_STRAIGHT = 0.3  # [m] straight ahead at the end, to settle in
_SPACING = 0.1  # [m]
_LONGEST_STEP = 3.0 * _SPACING  # [m] between neighbouring points put onto one surface; more is a leap
_SIDES = {"L": 1.0, "S": 0.0, "R": -1.0}


def with_first_turn(path: Path, mesh_map: MeshMap, blocked: BoolArray, turning_radius: float, pose: Pose) -> Path:
    """Bend the begin of a path so that a car at ``pose`` drives onto it; the path itself where it leads ahead anyway.

    That is the approach of the reversed path: from the goal to the pose of the robot, turned about.
    """
    backward = np.concatenate([path.positions[:0:-1], [pose.position]])
    turned_about = quaternion_multiply(pose.orientation, quaternion_from_yaw(math.pi))
    way_back = Path.from_points(backward, turned_about, frame_id=path.frame_id, stamp=path.stamp)
    bent = with_final_approach(way_back, mesh_map, blocked, turning_radius, _SMALL_TURN)
    if bent is way_back:
        return path
    return Path.from_points(bent.positions[::-1], path[-1].orientation, frame_id=path.frame_id, stamp=path.stamp)


def with_final_approach(
    path: Path, mesh_map: MeshMap, blocked: BoolArray, turning_radius: float, small_corner: float = _SMALL_CORNER
) -> Path:
    """Bend the end of a path so that it arrives with the heading of its last pose.

    The path stays as it is where it arrives that way already, or where no curve fits on the free surface.

    Parameters
    ----------
    blocked : (V,) bool
        Vertices the curve must not come near.
    turning_radius : float
        Of the arcs [m].
    small_corner : float
        Up to this angle [rad] between its end and the goal's heading the path stays as it is.
    """
    tracker = PathTracker(path)
    if tracker.length < _SPACING or _corner_at_goal(path) < small_corner:
        return path
    best, best_length = path, np.inf
    for distance in [radii * turning_radius for radii in _LEAVING]:
        leaves_at = max(tracker.length - distance, 0.0)
        curve = _curve_to_goal(path, tracker, leaves_at, turning_radius)
        spots = mesh_map.locate(curve, distance + turning_radius)
        length = leaves_at + _SPACING * len(curve)
        if _fits(mesh_map, blocked, curve, spots) and length < best_length:
            kept = path.positions[tracker.lengths < leaves_at]
            positions = np.concatenate([kept, spots.points, path.positions[-1:]])
            best = Path.from_points(positions, path[-1].orientation, frame_id=path.frame_id, stamp=path.stamp)
            best_length = length
    return best


def _fits(mesh_map: MeshMap, blocked: BoolArray, curve: FloatArray, spots: Location) -> bool:
    """Whether a curve (n, 3) lies on free surface throughout: past no border, and no part on another storey."""
    if (spots.faces < 0).any() or blocked[mesh_map.faces[spots.faces]].any():
        return False
    steps = norm(np.diff(spots.points, axis=0))
    return not beyond_border(mesh_map.topology, curve, spots).any() and bool((steps <= _LONGEST_STEP).all())


def _corner_at_goal(path: Path) -> float:
    """Angle [rad] between the last step of a path and the heading of its last pose."""
    step = path.positions[-1] - path.positions[-2]
    cosine = float(scalar_products(step, path[-1].rotation[:, 0])) / max(float(norm(step)), 1e-9)
    return math.acos(min(max(cosine, -1.0), 1.0))


def _curve_to_goal(path: Path, tracker: PathTracker, leaves_at: float, radius: float) -> FloatArray:
    """Points (n, 3) in the goal's tangent plane from ``leaves_at`` [m] of the path to the straight piece at the end."""
    goal = path[-1]
    start, ahead = rotated_back(goal.rotation, tracker.points_at(np.array([leaves_at, leaves_at + 0.5 * _SPACING])))
    end = path.positions[-1] - _STRAIGHT * goal.rotation[:, 0]
    x, y, _ = start - rotated_back(goal.rotation, end)
    yaw = math.atan2(ahead[1] - start[1], ahead[0] - start[0])
    flat = dubins_curve((x, y, yaw), radius, _SPACING)
    flat = np.concatenate([flat, [[0.0, 0.0]]])
    return np.asarray(rotated(goal.rotation, np.column_stack([flat, np.zeros(len(flat))])) + end)


def dubins_curve(start: tuple[float, float, float], radius: float, spacing: float) -> FloatArray:
    """Shortest arc, line, arc from a pose (x, y, yaw) to the origin looking along x.

    Returns
    -------
    (n, 2) float64
        Points [m] every ``spacing`` [m], the start included, the origin not.
    """
    x, y, yaw = start
    distance, bearing = math.hypot(x, y) / radius, math.atan2(-y, -x)
    words = _words(distance, (yaw - bearing) % math.tau, -bearing % math.tau)
    name, lengths = min(words.items(), key=lambda word: sum(word[1]))
    # Turn rate along the curve, sampled in the middle of every step.
    along = np.arange(0.0, sum(lengths) * radius, spacing)
    edges = np.cumsum(lengths) * radius
    sides = np.array([_SIDES[side] for side in name])
    corners = np.concatenate([[0.0], edges])
    headings = yaw + np.concatenate([[0.0], np.cumsum(sides * np.diff(corners) / radius)])
    points = [np.array([x, y])]
    for begin, end in itertools.pairwise(along):
        heading = float(np.interp(0.5 * (begin + end), corners, headings))
        points.append(points[-1] + (end - begin) * np.array([math.cos(heading), math.sin(heading)]))
    return np.array(points)


def _words(d: float, a: float, b: float) -> dict[str, tuple[float, float, float]]:
    """Lengths in radii of the curves that exist between the headings a and b [rad], ``d`` radii apart."""
    words = {}
    for name, side in (("LSL", 1.0), ("RSR", -1.0)):
        squared = 2.0 + d * d - 2.0 * math.cos(a - b) + 2.0 * d * side * (math.sin(a) - math.sin(b))
        turn = math.atan2(side * (math.cos(b) - math.cos(a)), d + side * (math.sin(a) - math.sin(b)))
        arcs = side * (turn - a) % math.tau, side * (b - turn) % math.tau
        words[name] = arcs[0], math.sqrt(max(squared, 0.0)), arcs[1]
    for name, side in (("LSR", 1.0), ("RSL", -1.0)):
        squared = d * d - 2.0 + 2.0 * math.cos(a - b) + 2.0 * d * side * (math.sin(a) + math.sin(b))
        if squared < 0.0:
            continue
        line = math.sqrt(squared)
        turn = math.atan2(-side * (math.cos(a) + math.cos(b)), d + side * (math.sin(a) + math.sin(b)))
        turn -= math.atan2(-2.0 * side, line)
        words[name] = side * (turn - a) % math.tau, line, side * (turn - b) % math.tau
    return words
