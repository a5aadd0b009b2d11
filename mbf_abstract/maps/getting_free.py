"""How a robot that cannot drive or turn as it would like gets away from where it stands, on any map.

When to use: in the texts of planners that refuse a start, so that a user or an executive knows which recovery helps.
When not: to move the robot; ``back_up``, ``rotate`` and ``move_away`` do, and check as they go.
"""

from __future__ import annotations

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.queries import PADDED, CellState, PlaceAnswer

MOTIONS = (
    ("backing up", Twist.planar(-1.0), "m"),
    ("driving on", Twist.planar(1.0), "m"),
    ("turning left", Twist.planar(wz=1.0), "rad"),
    ("turning right", Twist.planar(wz=-1.0), "rad"),
)
SIDEWAYS = (("moving left", Twist.planar(0.0, 1.0), "m"), ("moving right", Twist.planar(0.0, -1.0), "m"))
"""Named only where nothing else helps: few robots can."""
DISTANCES = (0.1, 0.2, 0.3, 0.5, 0.75, 1.0)
"""How far [m or rad] each motion is followed."""
WORTH_NAMING = 0.3
"""A robot that touches nothing where it stands gets on only by a motion so far [m or rad]."""


def getting_free(navigation_map: NavigationMap, pose: Pose) -> str:
    """Name the motions that take the robot from ``pose``, in the frame of the map, to where it touches nothing."""
    ways = _ways(navigation_map, pose, MOTIONS) or _ways(navigation_map, pose, SIDEWAYS)
    return f"it gets away by {' or '.join(ways)}" if ways else "no straight motion and no turn on the spot gets it away"


def _ways(navigation_map: NavigationMap, pose: Pose, motions: tuple[tuple[str, Twist, str], ...]) -> list[str]:
    """Texts of the motions that help."""
    check = navigation_map.pose_check(PADDED)
    least = 0.0 if _is_blocked(check(pose)) else WORTH_NAMING
    ways = []
    for name, motion, unit in motions:
        for distance in DISTANCES:
            if navigation_map.obstacle_ahead(pose, motion, distance):
                break
            x, y, yaw = arc_poses((pose.x, pose.y, pose.yaw), *_planar(motion), distance, distance)[-1].tolist()
            there = Pose((x, y, pose.z), Pose.planar(0.0, 0.0, yaw).orientation, pose.frame_id)
            if distance >= least and not _is_blocked(check(there)):
                ways.append(f"{name} {distance:g} {unit}")
                break
    return ways


def _is_blocked(answer: PlaceAnswer) -> bool:
    """Whether the robot touches something, or reaches off the map, which hides what it touches beside that."""
    return CellState.LETHAL in (answer.state, answer.known) or answer.state is CellState.OUTSIDE


def _planar(motion: Twist) -> tuple[float, float, float]:
    return motion.vx, motion.vy, motion.wz
