"""Ground, walls, obstacles and actors without physics: the world of ``terrain.physics.kinematic_robot``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy import ndimage

from mbf_abstract.geometry import FloatArray, Pose
from terrain.physics.contact_depth import depth_in_cells, placed
from terrain.physics.motion_sample import Thing
from terrain.physics.protocols import SimulatedWorld
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.occupancy import OccupancyGrid, wall_surface
from terrain.worlds.surface import Surface, joined, level_rectangle
from terrain.worlds.upright_solids import UprightSolid

TIME_STEP = 1.0 / 60.0
NOTHING: frozenset[Thing] = frozenset()
FLOOR = 1000.0  # m; half the size of the floor that sensors see in a world without a map


class MovingRobot(Protocol):
    """What the world asks of a robot."""

    def advance(self, seconds: float) -> None:
        """Move on by one small time step."""


class KinematicWorld(SimulatedWorld):
    """Ground and walls without physics; has the clock and the interface that ``Simulation`` steps.

    Parameters
    ----------
    terrain : Heightfield, optional
        Ground; level at z = 0 without it.
    building : OccupancyGrid, optional
        Its occupied cells are walls.
    """

    def __init__(self, terrain: Heightfield | None = None, building: OccupancyGrid | None = None) -> None:
        super().__init__(TIME_STEP)
        self.terrain = terrain
        self.building = building
        self.robots: list[MovingRobot] = []
        self.solids: list[UprightSolid] = []
        self._clearance: FloatArray | None = None
        if building is not None:
            distance = ndimage.distance_transform_edt(~building.occupied)
            self._clearance = np.asarray(distance, dtype=float) * building.resolution

    def close(self) -> None:
        """Do nothing; there is nothing to free."""

    def _move_on(self) -> None:
        self.step_count += 1
        for robot in self.robots:
            robot.advance(TIME_STEP)

    def add_box(self, pose: Pose, size: Sequence[float], moving: bool = False) -> int:
        """Stand a box of ``size`` (3,) [m] with its middle at ``pose``; ``moving`` if it will be moved."""
        self.solids.append(UprightSolid(pose, size, moving))
        return len(self.solids) - 1

    def add_cylinder(self, pose: Pose, radius: float, height: float, moving: bool = False) -> int:
        """Stand a cylinder; as ``add_box``."""
        return self.add_box(pose, (radius, height), moving)

    def place_body(self, body: int, pose: Pose) -> None:
        """Put a box or cylinder at ``pose`` at once."""
        self.solids[body].pose = pose

    @property
    def has_moving_bodies(self) -> bool:
        """Whether anything may move besides the robots."""
        return any(solid.moving for solid in self.solids)

    def contains(self, x: float, y: float, margin: float = 0.0) -> bool:
        """Whether there is ground at (x, y) [m], and at all places within ``margin`` [m] along x and y."""
        terrain = self.terrain
        return terrain is None or (
            terrain.x0 <= x - margin
            and x + margin <= terrain.x_max
            and terrain.y0 <= y - margin
            and y + margin <= terrain.y_max
        )

    def contact(
        self,
        outline: FloatArray,
        x: float,
        y: float,
        yaw: float,
        reach: float,
        gap: float = 0.0,
        fellows: Sequence[UprightSolid] = (),
    ) -> tuple[float, frozenset[Thing]]:
        """Penetration depth [m] of a robot in walls, obstacles, actors and robots, and which of them it touches.

        Parameters
        ----------
        outline : (n, 2) float
            Convex, counter-clockwise, in base_link [m].
        x, y, yaw : float
            Where base_link is.
        reach : float
            Distance [m] from there to the farthest corner.
        gap : float
            Things nearer than this [m] count as touched, less than a cell of the building.
        fellows : sequence of UprightSolid
            The other robots.

        Returns
        -------
        depth : float
            Below 0 where it touches nothing.
        touched : frozenset of Thing
        """
        if not self.solids and not fellows and self.building is None:
            return -math.inf, NOTHING
        near = [
            (solid, self.things.get(body, Thing.WALL))
            for body, solid in enumerate(self.solids)
            if solid.distance(x, y) < reach + gap
        ]
        near += [(solid, Thing.ROBOT) for solid in fellows if solid.distance(x, y) < reach + gap]
        grid = self.building
        if grid is not None and self._wall_clearance(x, y) > reach + 2.0 * grid.resolution:
            grid = None
        if grid is None and not near:
            return -math.inf, NOTHING
        corners = placed(outline, x, y, yaw)
        depths = [(solid.depth(corners), thing) for solid, thing in near]
        if grid is not None:
            origin = np.array([grid.origin_x, grid.origin_y])
            depths.append((depth_in_cells(corners, grid.occupied, grid.resolution, origin), Thing.WALL))
        return max(depth for depth, _ in depths), frozenset(thing for depth, thing in depths if depth > -gap)

    def _wall_clearance(self, x: float, y: float) -> float:
        """Distance [m] between the cell at (x, y) and the nearest occupied one, from middle to middle."""
        if self.building is None or self._clearance is None:
            return math.inf
        ix = math.floor((x - self.building.origin_x) / self.building.resolution)
        iy = math.floor((y - self.building.origin_y) / self.building.resolution)
        ny, nx = self._clearance.shape
        return float(self._clearance[iy, ix]) if 0 <= ix < nx and 0 <= iy < ny else math.inf

    def pose_at(self, x: float, y: float, yaw: float) -> Pose:
        """Pose on the ground; on a heightfield tilted with it. Raises ValueError off the terrain."""
        return Pose.planar(x, y, yaw) if self.terrain is None else self.terrain.pose_at(x, y, yaw)

    def static_surface(self) -> Surface:
        """All that sensors can see and that does not move, as one mesh."""
        return joined([*self._ground(), *(solid.surface() for solid in self.solids if not solid.moving)])

    def _ground(self) -> list[Surface]:
        """The ground, and the walls of the building."""
        if self.terrain is not None:
            return [self.terrain.surface()]
        floor = level_rectangle(-FLOOR, FLOOR, -FLOOR, FLOOR)
        return [floor] if self.building is None else [floor, wall_surface(self.building)]
