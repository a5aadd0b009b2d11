"""Goals that are areas: a disc, a polygon, or a set of poses. Reaching any place inside is success.

Use one where the exact pose does not matter ("into the kitchen", "to one of the three charging stations"): the
planner is asked for a path to every member, the cheapest wins, and the robot stops as soon as it is inside. Do not use
a large area where one pose would do: each member costs one call of the planner. Areas are given in any frame that the
server knows, and stay where they are in the global frame when the goal begins.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.polygon import inside_polygon
from mbf_abstract.geometry.tangent_plane import SAME_STOREY, heading_error
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.arrival_tolerance import plan_tolerance_problem
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult


class GoalArea(ABC):
    """Where a goal may end."""

    @property
    @abstractmethod
    def frame_id(self) -> str:
        """Frame the area is given in."""

    def contains(self, pose: Pose) -> bool:
        """Whether a robot at ``pose`` is inside."""
        return self.depth(pose) >= 0.0

    @abstractmethod
    def depth(self, pose: Pose) -> float:
        """How far [m] a robot at ``pose`` can move in any direction and stay inside; negative where it is outside."""

    @abstractmethod
    def members(self) -> tuple[Pose, ...]:
        """Poses inside that a planner is asked for; never empty."""


@dataclass(frozen=True)
class DiscArea(GoalArea):
    """All places within ``radius`` [m], in 3D, of a centre; any heading."""

    center: Pose
    radius: float

    def __post_init__(self) -> None:
        if not 0.0 < self.radius < math.inf:
            raise ValueError(f"the radius must be positive and finite, got {self.radius}")

    @property
    def frame_id(self) -> str:
        """Frame of the centre."""
        return self.center.frame_id

    def depth(self, pose: Pose) -> float:
        """Distance [m] from the circle."""
        return self.radius - pose.distance_to(self.center)

    def members(self) -> tuple[Pose, ...]:
        """The centre, and eight poses at two thirds of the radius for centres that cannot be reached."""
        x, y, z = self.center.position
        ring = self.radius * 2.0 / 3.0
        angles = [k * math.pi / 4.0 for k in range(8)]
        around = [(x + ring * math.cos(angle), y + ring * math.sin(angle), z) for angle in angles]
        return (self.center, *(replace(self.center, position=position) for position in around))


@dataclass(frozen=True)
class PolygonArea(GoalArea):
    """The inside of a simple polygon, seen from above, on the storey of its corners; any heading.

    Heights from ``SAME_STOREY`` below the lowest corner to as much above the highest one are on that storey.

    Parameters
    ----------
    corners : tuple of (x, y, z)
        In order, at least three [m].
    """

    corners: tuple[tuple[float, float, float], ...]
    frame_id: str = "map"

    def __post_init__(self) -> None:
        if len(self.corners) < 3:
            raise ValueError(f"a polygon has at least three corners, got {len(self.corners)}")
        for corner in self.corners:
            if len(corner) != 3:
                raise ValueError(f"a corner of a polygon has x, y and z [m], got {tuple(corner)}")
        if not abs(self._area()) > 0.0:
            raise ValueError("the polygon encloses no area")

    def depth(self, pose: Pose) -> float:
        """Distance [m] from the nearest edge, inside by the even-odd rule; from another storey, to the area in 3D."""
        nearest = math.inf
        for (x1, y1, _), (x2, y2, _) in zip(self.corners, self.corners[1:] + self.corners[:1], strict=True):
            dx, dy, px, py = x2 - x1, y2 - y1, pose.x - x1, pose.y - y1
            share = min(max((px * dx + py * dy) / max(dx * dx + dy * dy, 1e-18), 0.0), 1.0)
            nearest = min(nearest, math.hypot(px - share * dx, py - share * dy))
        inside = inside_polygon(np.array([pose.position]), np.array(self.corners))[0]
        heights = [z for _, _, z in self.corners]
        off_storey = max(min(heights) - pose.z, pose.z - max(heights)) - SAME_STOREY
        if off_storey > 0.0:
            return -math.hypot(0.0 if inside else nearest, off_storey)
        return nearest if inside else -nearest

    def members(self) -> tuple[Pose, ...]:
        """Poses of a 5 x 5 grid over the bounding box that are well inside; of a thin polygon the middle of one ear.

        An ear is a triangle of three neighbouring corners that lies inside; every simple polygon has at least two.
        Well inside is half as deep as the deepest: a robot that stops a little before the pose is inside too.
        """
        xs, ys, zs = zip(*self.corners, strict=True)
        z = sum(zs) / len(zs)
        steps = [0.1, 0.3, 0.5, 0.7, 0.9]
        grid = [
            Pose((min(xs) + (max(xs) - min(xs)) * a, min(ys) + (max(ys) - min(ys)) * b, z), frame_id=self.frame_id)
            for a in steps
            for b in steps
        ]
        deepest = max(self.depth(pose) for pose in grid)
        if deepest > 0.0:
            return tuple(pose for pose in grid if self.depth(pose) >= 0.5 * deepest)
        return (max(self._triangle_centres(z), key=self.depth),)

    def _area(self) -> float:
        edges = zip(self.corners, self.corners[1:] + self.corners[:1], strict=True)
        return 0.5 * sum(x1 * y2 - x2 * y1 for (x1, y1, _), (x2, y2, _) in edges)

    def _triangle_centres(self, z: float) -> tuple[Pose, ...]:
        """Centroids of the triangles of three neighbouring corners."""
        n = len(self.corners)
        triangles = [[self.corners[(i + k) % n] for k in range(3)] for i in range(n)]
        return tuple(
            Pose((sum(c[0] for c in three) / 3.0, sum(c[1] for c in three) / 3.0, z), frame_id=self.frame_id)
            for three in triangles
        )


@dataclass(frozen=True)
class PoseSetArea(GoalArea):
    """One of several poses, within tolerances [m, rad]."""

    poses: tuple[Pose, ...]
    dist_tolerance: float = 0.1
    angle_tolerance: float = math.pi

    def __post_init__(self) -> None:
        if not self.poses or len({pose.frame_id for pose in self.poses}) > 1:
            raise ValueError("a set of goal poses has at least one pose, and all in one frame")
        if problem := plan_tolerance_problem(self.dist_tolerance, self.angle_tolerance):
            raise ValueError(problem)

    @property
    def frame_id(self) -> str:
        """Frame of the poses."""
        return self.poses[0].frame_id

    def depth(self, pose: Pose) -> float:
        """What is left [m] of the tolerance at the nearest member; one with another heading is out of reach."""
        headings = [abs(heading_error(pose, member)) <= self.angle_tolerance for member in self.poses]
        gaps = [pose.distance_to(member) for member, looks in zip(self.poses, headings, strict=True) if looks]
        return self.dist_tolerance - min(gaps, default=math.inf)

    def members(self) -> tuple[Pose, ...]:
        """The poses."""
        return self.poses


def plan_to_area(make_plan: Callable[[PlanRequest], PlanResult], request: PlanRequest, area: GoalArea) -> PlanResult:
    """Ask for a path to every member and answer the cheapest.

    The path leads on to the member, not to the border only: a robot that slows down at a border might never cross it.

    Without any success the answer is the one for the first member. A canceled request ends between two calls.
    """
    answers: list[PlanResult] = []
    for member in area.members():
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
        answers.append(make_plan(replace(request, goal=member)))
    reached = [answer for answer in answers if answer.success and answer.path is not None and len(answer.path)]
    if not reached:
        return answers[0]
    return min(reached, key=_cost)


def _cost(answer: PlanResult) -> float:
    assert answer.path is not None
    return answer.cost if answer.cost != 0.0 else answer.path.length


@dataclass(frozen=True)
class TransformedArea(GoalArea):
    """An area of any kind, placed once: it stays where it is if the frames move against each other later.

    Attributes
    ----------
    area : GoalArea
        In the child frame of the transform.
    transform : Transform
        From the frame of the area to the one in which it is asked for.
    """

    area: GoalArea
    transform: Transform

    @property
    def frame_id(self) -> str:
        """Frame in which it is asked for."""
        return self.transform.parent

    def depth(self, pose: Pose) -> float:
        """That of the pose in the frame of the area."""
        return self.area.depth(self.transform.inverse().apply_to_pose(pose))

    def members(self) -> tuple[Pose, ...]:
        """Those of the area."""
        return tuple(self.transform.apply_to_pose(member) for member in self.area.members())
