"""A tiled map behind the contract of navigation maps: what sensors change, whose turn it is to search, its pictures.

What sensors have seen in the window around the robot counts for questions (``questions``) and plans anywhere.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.polyline import places_between
from mbf_abstract.maps.view import GridView
from mbf_mesh_nav.arrays import FlagArray, FloatArray
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.borders import BORDER_SLACK
from mbf_mesh_nav.tiles.portals import NOT_CANCELLED
from mbf_mesh_nav.tiles.sensed import NOTHING_SENSED, SensedCosts
from mbf_mesh_nav.tiles.serving.moment import Moment
from mbf_mesh_nav.tiles.serving.overview import overview, with_sensed
from mbf_mesh_nav.tiles.serving.questions import TileQuestions
from mbf_mesh_nav.tiles.serving.recently_used import RecentlyUsed
from mbf_mesh_nav.tiles.serving.squares import Squares
from mbf_mesh_nav.tiles.serving.windows.following_window import FollowingWindow
from mbf_mesh_nav.tiles.serving.windows.window_settings import WindowSettings
from mbf_mesh_nav.tiles.tile import TileKey
from mbf_mesh_nav.tiles.tiled_map import TiledMap

PLACES_A_TILE = 8.0
"""Places per length of a tile at which lines between poses are looked up."""
NO_WINDOW = "the map of tiles has no window around the robot"
LARGE_ROBOT = "tiles built for a robot with a radius of {:g} m, this one has {:g} m: what it touches may count as free"
NO_VIEW = GridView(np.zeros((0, 0), dtype=np.float32), (0.0,) * 4)
CANCEL_PERIOD = 0.05
"""How often [s] a goal that waits for the search of another one looks whether it is cancelled."""


class TiledNavigationMap(TileQuestions):
    """A map of tiles.

    Parameters
    ----------
    window : WindowSettings, optional
        Of the part around the robot that changes. Without it nothing senses, and nothing changes but by
        ``change_layer``.

    Attributes
    ----------
    tiled : TiledMap
        Takes one thread at a time: see ``turn_to_search``.

    Raises
    ------
    MeshError
        A tile is damaged.
    """

    def __init__(
        self,
        tiled: TiledMap,
        inscribed_radius: float = 0.0,
        max_turning_slope: float = MeshMap.max_turning_slope,
        window: WindowSettings | None = None,
    ) -> None:
        super().__init__()
        self.tiled = tiled
        self.frame_id = tiled.index.frame_id
        self.follows_robot = window is not None
        self._searching = threading.Lock()
        self._radius, self._max_turning_slope = inscribed_radius, max_turning_slope
        self._squares = Squares(tiled)
        self._window = None if window is None else FollowingWindow(tiled, self._squares, window)
        self._no_layers = LayerGraph()
        self._views: RecentlyUsed[str, GridView] = RecentlyUsed(self._picture, len(tiled.index.layers))
        self._shown: tuple[GridView | None, SensedCosts, GridView] = None, NOTHING_SENSED, NO_VIEW  # the last picture

    @property
    def layers(self) -> LayerGraph:  # type: ignore[override]
        """Those of the window, other ones when it has moved."""
        return self._no_layers if self._window is None else self._window.now.map.layers

    @property
    def inscribed_radius(self) -> float:
        """Radius [m] of the disc that stands for the robot: the one that was given, else that of the map's layers."""
        return self._radius or self.tiled.index.inscribed_radius

    @property
    def spacing(self) -> float:
        """About how far [m] vertices lie from each other."""
        return self.tiled.index.spacing

    @property
    def reach(self) -> float:
        """How far [m] around a place a question can look."""
        return self._squares.reach

    @property
    def senses(self) -> bool:
        """Whether sensors change the map."""
        return self._window is not None and self._window.senses

    @property
    def window_map(self) -> MeshMap:
        """The window around the robot, another one when it has moved; ValueError on a map without."""
        if self._window is None:
            raise ValueError(NO_WINDOW)
        return self._for_robot(self._window.now.map)

    def require_room(self, looks: float) -> None:
        """ValueError unless what lies ``looks`` [m] around the robot is in the window at any time."""
        if looks == math.inf:
            raise ValueError("needs the whole mesh in memory, which a map of tiles is not, or states no reach")
        if self._window is None:
            raise ValueError(NO_WINDOW)
        self._window.settings.require_room(looks)

    @contextmanager
    def held_window(self) -> Iterator[None]:
        """Keep the window in its place for the time of a ``with`` block, see ``FollowingWindow.held``."""
        if self._window is None:
            raise ValueError(NO_WINDOW)
        with self._window.held():
            yield

    def take_parameters(self, parameters: Any) -> None:
        """Take over ``inscribed_radius`` and ``footprint``."""
        self.fit_layers(parameters.inscribed_radius)
        self._radius, self.footprint = parameters.inscribed_radius, parameters.footprint

    def configuration_warnings(self) -> list[str]:
        """Those of its layers, and one for a robot larger than the one that the tiles were built for."""
        built, radius = self.tiled.index.inscribed_radius, self.inscribed_radius
        large = LARGE_ROBOT.format(built, radius) if 0.0 < built < radius else ""
        return [*super().configuration_warnings(), *filter(None, [large])]

    def first_outside(self, positions: FloatArray) -> int:
        """Index of the first of positions (n, 3) [m] with no tile above or below it, or -1; holes do not count."""
        plan = positions[:, :2]
        outside = np.ones(len(plan), dtype=np.bool_)
        for key in self.tiled.index.tiles_in((*plan.min(axis=0), -np.inf, *plan.max(axis=0), np.inf)):
            box = self.tiled.index.entries[key].box
            low, high = np.array(box[:2]) - BORDER_SLACK, np.array(box[3:5]) + BORDER_SLACK
            outside &= ((plan < low) | (plan > high)).any(axis=1)
        return int(np.argmax(outside)) if outside.any() else -1

    def first_line_outside(self, positions: FloatArray) -> int:
        """Index of the first of positions (n, 3) [m] whose line to the next is over a place without a tile, or -1."""
        places, lines = places_between(positions, self.tiled.index.tile_size / PLACES_A_TILE)
        index = self.first_outside(places) if len(places) else -1
        return int(lines[index]) if index >= 0 else -1

    def moment(self, sensed: bool = True) -> Moment:
        """The map as it is now, or without what sensors have seen."""
        window = self._window.now if self._window is not None and sensed else None
        return Moment(self._squares, window, self._for_robot)

    @contextmanager
    def turn_to_search(self, cancel_flag: FlagArray = NOT_CANCELLED) -> Iterator[Moment | None]:
        """Have ``tiled`` for one thread, as it is at one moment: no tile and no sensed cost changes until it is done.

        None, and not for it, if the flag was set before others were done with it.

        Raises
        ------
        MeshError
            A tile with sensed costs is damaged.
        """
        while not self._searching.acquire(timeout=CANCEL_PERIOD):
            if cancel_flag[0] != 0:
                yield None
                return
        try:
            moment = self.moment()
            self.tiled.lay_over(moment.sensed)
            yield moment
        finally:
            self._searching.release()

    def change_layer(self, key: TileKey, layer: str, costs: CostArray, lethal: LethalArray) -> None:
        """``TiledMap.change_layer``, between two searches; every later question and plan has the new values."""
        with self.turn_to_search():
            self.tiled.change_layer(key, layer, costs, lethal)
        self._squares.clear()
        self._views.clear()
        if self._window is not None:
            self._window.renew()

    def view(self, layer: str) -> GridView:
        """The costs of a layer from above, that of the profile with what sensors have raised.

        The first time, and after a change of a tile, all tiles are read for it.

        Raises
        ------
        MeshError
            A tile is damaged.
        """
        stored = self._views.get(layer)
        if layer != self.tiled.profile_layer or not self.senses:
            return stored
        sensed, (of_stored, of_sensed, shown) = self.moment().sensed, self._shown
        if of_stored is not stored or of_sensed is not sensed:
            shown = with_sensed(stored, sensed)
            self._shown = stored, sensed, shown
        return shown

    # -------------------------------------------------------------------------------------------------- layers
    def update(self, robot_pose: Pose | None, now: float) -> None:
        """Take in what sensors have seen, see ``FollowingWindow.update``; overrides of parameters that are over end."""
        self.end_overrides(now)
        if self._window is not None:
            self._window.update(robot_pose, now)

    def stale_reason(self, now: float) -> str:
        """Why the map is not current at ``now`` [s]; without a window it is."""
        return "" if self._window is None else self._window.stale_reason(now)

    def clear(self, layer_names: Iterable[str] | None = None) -> list[str]:
        """Forget all sensed obstacles, or those in some layers, at once; return the names of the layers."""
        return [] if self._window is None else self._window.cleared(lambda one: one.clear(layer_names))

    def clear_area(
        self, center: Pose, size: float, layer_names: Iterable[str] | None = None, *, inside: bool = True
    ) -> list[str]:
        """Forget obstacles sensed inside, or outside, a square of side ``size`` [m] around a pose, as ``clear``."""
        if self._window is None:
            return []
        return self._window.cleared(lambda one: one.clear_area(center, size, layer_names, inside=inside))

    def _replace_parameters(self, name: str, parameters: LayerParameters) -> None:
        if self._window is not None:  # else there is no layer of that name
            self._window.set_layer_parameters(name, parameters)

    # ---------------------------------------------------------------------------------------------- surroundings
    def _for_robot(self, mesh_map: MeshMap) -> MeshMap:
        """A part of the map with the robot's figures of now."""
        mesh_map.inscribed_radius, mesh_map.footprint = self.inscribed_radius, self.footprint
        mesh_map.max_turning_slope = self._max_turning_slope
        return mesh_map

    def _picture(self, layer: str) -> GridView:
        return overview(self.tiled, self.tiled.index.layers.index(layer))
