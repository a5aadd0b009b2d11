"""Our robot and the shuttles in one warehouse, without physics: their motions and contacts.

A motion that would make outlines overlap does not take place and counts as a contact of the one that moved. A contact
that lasts, or comes again within a second, counts once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from mbf_abstract.geometry import Pose
from terrain.experiments.table1.environments.traffic import CARRIER, Box, Shuttle
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import TIME_STEP, KinematicWorld
from terrain.worlds.occupancy import OccupancyGrid

CONTACT_PAUSE = 1.0  # s without contact after which the next one counts anew

OnContact = Callable[[str, str], None]


class WarehouseWorld(KinematicWorld):
    """Steps our robot, then the shuttles in their order.

    Parameters
    ----------
    on_contact : callable
        Called with ``(with_what, who_moved)`` once for each contact: "rack" or "robot", "we" or "they".
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
                self.contact_began("robot", "they")

    def contact_began(self, with_what: str, who_moved: str) -> None:
        """Note a contact; report it if it is a new one."""
        last = self._last_contact.get((with_what, who_moved), -math.inf)
        self._last_contact[with_what, who_moved] = self.time
        if self.time - last > CONTACT_PAUSE:
            self._on_contact(with_what, who_moved)


class WarehouseRobot(KinematicRobot):
    """Our robot: the racks and the shuttles stop it."""

    world: WarehouseWorld

    def __init__(self, world: WarehouseWorld, pose: Pose) -> None:
        super().__init__(world, CARRIER, pose)
        self.distance = 0.0

    @property
    def box(self) -> Box:
        """Where it stands now."""
        return Box(self._x, self._y, self._yaw)

    def advance(self, seconds: float) -> None:
        """Move on by one small time step, unless that would touch something."""
        before = self._x, self._y, self._yaw
        super().advance(seconds)
        if self._blocked:
            self.world.contact_began("rack", "we")
        if any(self.box.overlaps(shuttle.box) for shuttle in self.world.shuttles):
            self._x, self._y, self._yaw = before
            self._vx = self._wz = 0.0
            self._blocked = True
            self.world.contact_began("robot", "we")
        self.distance += math.hypot(self._x - before[0], self._y - before[1])
