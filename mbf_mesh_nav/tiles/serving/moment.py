"""A map of tiles as it is at one moment: every answer and every leg of a plan counts the same sensed obstacles."""

from __future__ import annotations

from collections.abc import Callable

from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.places import MeshPlaces
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.tiles.sensed import NOTHING_SENSED
from mbf_mesh_nav.tiles.serving.squares import Squares
from mbf_mesh_nav.tiles.serving.windows.window import Window


class Moment:
    """What lies around any place, now.

    Parameters
    ----------
    squares : Squares
        For places that the window does not hold.
    window : Window, optional
        Around the robot.
    for_robot : callable
        Gives a part of the map the robot's figures.

    Attributes
    ----------
    sensed : SensedCosts
        What sensors have raised until then.
    """

    def __init__(self, squares: Squares, window: Window | None, for_robot: Callable[[MeshMap], MeshMap]) -> None:
        self._squares, self._window, self._for_robot = squares, window, for_robot
        self._snapshot = None if window is None else window.map.snapshot()
        self.sensed = NOTHING_SENSED if window is None or self._snapshot is None else window.sensed(self._snapshot)

    def around(self, x: float, y: float, radius: float) -> tuple[MeshMap, MeshSnapshot] | None:
        """The map as far as ``radius`` [m] around a place, and farther, with its costs; None without a surface there.

        Raises
        ------
        MeshError
            A tile is damaged.
        """
        if self._window is not None and self._snapshot is not None and self._window.holds(x, y, radius):
            return self._for_robot(self._window.map), self._snapshot
        found = self._squares.around(x, y, radius, self.sensed)
        return None if found is None else (self._for_robot(found), found.snapshot())

    def within(self, low: tuple[float, float], high: tuple[float, float]) -> MeshMap | None:
        """What lies in a rectangle between two corners (x, y) [m], cut out anew; raises as ``around``."""
        found = self._squares.within(low, high)
        return None if found is None else self._for_robot(found.with_sensed(self.sensed))

    def places(self, x: float, y: float, radius: float) -> MeshPlaces | None:
        """What can be asked about places there; raises as ``around``."""
        found = self.around(x, y, radius)
        if found is None:
            return None
        there, snapshot = found
        return MeshPlaces(there.topology, there.locator, snapshot, there.inscribed_radius)
