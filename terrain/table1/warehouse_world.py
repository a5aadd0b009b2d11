"""Our robot and the shuttles in one warehouse, without physics: who moves where, and who touches whom.

A motion that would make outlines overlap does not take place and counts as a contact of the one that moved. A contact
that lasts, or comes again within a second, counts once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from mbf_abstract.arithmetic import plane_rotation, rotated
from mbf_abstract.geometry import Pose
from terrain.kinematic_robot import TIME_STEP, KinematicRobot, KinematicWorld
from terrain.occupancy import OccupancyGrid
from terrain.table1.robot import CARRIER, HALF_LENGTH, HALF_WIDTH
from terrain.table1.traffic import Box, Shuttle

CONTACT_PAUSE = 1.0  # s without contact after which the next one counts anew
OUTLINE_SPACING = 0.05  # m between the points of the outline that are looked up on the map

OnContact = Callable[[str, str], None]


class WarehouseWorld(KinematicWorld):
    """Steps our robot, then the shuttles in their order.

    Parameters
    ----------
    building : OccupancyGrid
    shuttles : sequence of Shuttle
    on_contact : callable
        Told ``(with_what, who_moved)`` once for each contact: "rack" or "robot", "we" or "they".
    """

    def __init__(self, building: OccupancyGrid, shuttles: Sequence[Shuttle], on_contact: OnContact) -> None:
        super().__init__(building=building)
        self.shuttles = list(shuttles)
        self._on_contact = on_contact
        self._last_contact: dict[tuple[str, str], float] = {}

    def step(self) -> None:
        """Advance by one time step."""
        super().step()
        ours = [robot.box for robot in self.robots if isinstance(robot, WarehouseRobot)]
        for shuttle in self.shuttles:
            before = shuttle.state
            others = [*ours, *(other.box for other in self.shuttles if other is not shuttle)]
            shuttle.advance(TIME_STEP, others)
            if any(shuttle.box.overlaps(box) for box in ours):
                shuttle.state = before
                shuttle.halt()
                self.contact("robot", "they")

    def contact(self, with_what: str, who_moved: str) -> None:
        """Note a contact; tell it if it is a new one."""
        last = self._last_contact.get((with_what, who_moved), -math.inf)
        self._last_contact[with_what, who_moved] = self.time
        if self.time - last > CONTACT_PAUSE:
            self._on_contact(with_what, who_moved)


class WarehouseRobot(KinematicRobot):
    """Our robot: its whole outline counts, against racks and against the shuttles."""

    world: WarehouseWorld

    def __init__(self, world: WarehouseWorld, pose: Pose) -> None:
        super().__init__(world, CARRIER, pose)
        self.distance = 0.0
        self._outline = _outline_points()

    @property
    def box(self) -> Box:
        """Where it stands now."""
        return Box(self._x, self._y, self._yaw)

    def advance(self, seconds: float) -> None:
        """Move on by one small time step, unless that would touch something."""
        before = self._x, self._y, self._yaw
        super().advance(seconds)
        touched = self._touched()
        if touched:
            self._x, self._y, self._yaw = before
            self._vx = self._wz = 0.0
            self._blocked = True
            self.world.contact(touched, "we")
        self.distance += math.hypot(self._x - before[0], self._y - before[1])

    def _touched(self) -> str:
        box = self.box
        if any(box.overlaps(shuttle.box) for shuttle in self.world.shuttles):
            return "robot"
        if self.world.clearance_at(self._x, self._y) > CARRIER.circumscribed_radius + 0.05:
            return ""
        building = self.world.building
        assert building is not None
        points = rotated(plane_rotation(self._yaw), self._outline) + np.array([self._x, self._y])
        cells = np.floor((points - (building.origin_x, building.origin_y)) / building.resolution).astype(int)
        return "rack" if building.occupied[cells[:, 1], cells[:, 0]].any() else ""


def _outline_points() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Points (n, 2) [m] around the outline in base_link."""
    along = np.linspace(-HALF_LENGTH, HALF_LENGTH, round(2.0 * HALF_LENGTH / OUTLINE_SPACING) + 1)
    across = np.linspace(-HALF_WIDTH, HALF_WIDTH, round(2.0 * HALF_WIDTH / OUTLINE_SPACING) + 1)
    sides = [np.column_stack([along, np.full(len(along), y)]) for y in (-HALF_WIDTH, HALF_WIDTH)]
    ends = [np.column_stack([np.full(len(across), x), across]) for x in (-HALF_LENGTH, HALF_LENGTH)]
    return np.concatenate([*sides, *ends])
