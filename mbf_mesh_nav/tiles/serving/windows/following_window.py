"""The window that is around the robot: a new one is cut out whenever it comes near the edge of the last one."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Pose
from mbf_mesh_nav.map.layer import LayerParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.tiles.serving.squares import BEYOND, Squares
from mbf_mesh_nav.tiles.serving.windows.window import Window
from mbf_mesh_nav.tiles.serving.windows.window_settings import WindowSettings
from mbf_mesh_nav.tiles.tiled_map import TiledMap

UNKNOWN_POSE = "the pose of the robot is unknown, so the window is not around it"
TILES_CHANGED = "the tiles have changed, and the window has not been cut out of them again"
LEFT = "the robot has left the window that a recovery drives on"


class FollowingWindow:
    """The window that is around the robot at this time; for any number of threads.

    Parameters
    ----------
    squares : Squares
        What windows are cut out with.

    Attributes
    ----------
    now : Window
        Until the robot's pose is known it lies anywhere on the surface.

    Raises
    ------
    MeshError
        A tile is damaged.
    """

    def __init__(self, tiled: TiledMap, squares: Squares, settings: WindowSettings) -> None:
        self._tiled, self._squares, self.settings = tiled, squares, settings
        self._problem = UNKNOWN_POSE if self.senses else ""
        self._outdated = ""  # why it is not of the tiles of now
        self._held = 0
        self._time: float | None = None  # of the last update [s]
        self._updating = threading.RLock()
        x, y, _ = squares.tile(tiled.index.tiles[0].key).vertices[0].tolist()
        first = self._opened(x, y, None)
        assert first is not None, "a vertex of a tile lies on the surface"
        self.now = first

    @property
    def senses(self) -> bool:
        """Whether any layer of it does."""
        return bool(self.settings.live)

    def update(self, robot: Pose | None, now: float) -> None:
        """Take in what sensors have seen up to ``now`` [s], on another window if the robot is too near the edge.

        Scans wait until the robot's pose is known for the first time. If the robot is out of the last window, what was
        seen is forgotten as by a clearing: it was not around the robot.

        Raises
        ------
        MeshError
            A tile is damaged; the window stays, and is stale.
        Exception
            What a layer raises, likewise.
        """
        with self._updating:
            window = self._around(robot)
            if robot is not None or self._time is not None:
                self._time = now
                self._show(window)

    def stale_reason(self, now: float) -> str:
        """Why it is not current at ``now`` [s].

        It is not around the robot, the tiles have changed, a layer raised, or a sensor is silent. Without layers that
        sense it only has to be of the present tiles, around a robot whose pose is known and on the surface.
        """
        return self._problem or self._outdated or self.now.map.stale_reason(now)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep the window of now for the time of a ``with`` block; it is stale if the robot leaves it meanwhile."""
        with self._updating:
            self._held += 1
        try:
            yield
        finally:
            with self._updating:
                self._held -= 1

    def cleared(self, clear: Callable[[MeshMap], list[str]]) -> list[str]:
        """What a function returns that clears layers; not while an update runs."""
        with self._updating:
            return clear(self.now.map)

    def set_layer_parameters(self, name: str, parameters: LayerParameters) -> None:
        """Give a layer of the configuration its parameters; ValueError for those of the tiles."""
        if name not in self.settings.live:
            raise ValueError(f"the layer {name!r} has the values of the tiles, no parameter of it can change")
        with self._updating:
            self.now.map.set_layer_parameters(name, parameters)

    def renew(self) -> None:
        """Cut it out again where it is, because the tiles have changed; stale until that succeeds, here or later.

        Raises as ``update``.
        """
        with self._updating:
            self._outdated = TILES_CHANGED
            if self._held:
                return
            try:
                made = self._opened(*self.now.middle, self.now)
            except BaseException as error:
                self._outdated = f"{TILES_CHANGED}: {error_text(error)}"
                raise
            self._show(made or self.now)

    def _show(self, window: Window) -> None:
        """Bring a window up to date and show it; one on which a layer raises is stale."""
        if window is not self.now:
            self._outdated = ""
        try:
            if self._time is not None:
                window.map.update(None, self._time)
        finally:
            self.now = window

    def _around(self, robot: Pose | None) -> Window:
        """The window for a robot; the last one and a reason where there is none around it."""
        if robot is None:
            return self._kept(UNKNOWN_POSE)
        if self._held:
            return self._kept("" if self.now.holds(robot.x, robot.y, 0.0) else LEFT)
        if self.now.is_central(robot.x, robot.y) and not self._outdated:
            return self._kept("")
        try:
            made = self._opened(robot.x, robot.y, self.now)
            if made is not None and self._time is not None and not self.now.holds(robot.x, robot.y, 0.0):
                made.map.clear()
        except BaseException as error:
            self._problem = f"the window around the robot cannot be made: {error_text(error)}"
            raise
        if made is None:
            return self._kept(f"there is no surface around the robot at ({robot.x:.2f}, {robot.y:.2f})")
        self._problem = ""
        return made

    def _kept(self, problem: str) -> Window:
        self._problem = problem if self.senses else ""
        return self.now

    def _opened(self, x: float, y: float, old: Window | None) -> Window | None:
        """A window around a place [m]; None where there is no surface."""
        half = 0.5 * self.settings.side + BEYOND * self._tiled.index.spacing
        found = self._squares.within((x - half, y - half), (x + half, y + half))
        return None if found is None else Window(found, (x, y), self.settings, self._tiled.profile_layer, old)
