"""A costmap made of ordered layers, shared by everything that navigates on it.

Only the box of cells that a layer reports as changed is recomputed. Plugins never see the cells that are being
written: ``snapshot`` hands out a read-only copy, cached until the next change. One lock protects the cells; it is held
for the time of one update, never while code of a plugin or a server runs.

When to use: for each map of a costmap server, a static one of the size of its map file and a rolling one around the
robot. When not: for a single fixed grid (tests, offline planning) a plain ``Costmap`` is enough.

The order of work, bounds and the combination rules are those of costmap_2d.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.avoided_places import AvoidedPlace
from mbf_abstract.maps.layers.layer_list import making
from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_costmap_nav.grid.costmap import EMPTY_BOX, FREE, UNKNOWN, CellArray, CellBox, Costmap, GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.cell_causes import CellCauses
from mbf_costmap_nav.map.cell_window import CellWindow
from mbf_costmap_nav.map.layer import CostmapLayer
from mbf_costmap_nav.map.layer_answers import legal_box
from mbf_costmap_nav.map.permanent_layers import PermanentLayers


class LayeredCostmap(CellCauses):
    """Layers and the cells they produce.

    Parameters
    ----------
    geometry : GridGeometry
        Grid of the map; a layer that prefers another one (a static map) replaces it unless the window rolls.
    layers : sequence of CostmapLayer
        In order of writing. Names must be unique.
    footprint : Footprint
        The robot's outline without padding.
    footprint_padding : float
        Padding [m] by costmap_2d's sign rule; layers and radii use the padded outline.
    frame_id : str
        Frame of the grid.
    rolling_window : bool
        Keep the grid centred on the robot, moving by whole cells.
    track_unknown_space : bool
        Start cells as unknown instead of free.
    max_age : float
        Seconds after the last update at which the map stops being current; 0 = never.

    Attributes
    ----------
    last_update : float or None
        Time [s] of the last update; None before the first one.

    Raises
    ------
    LayerListError
        Two layers share a name.
    """

    def __init__(
        self,
        geometry: GridGeometry,
        layers: Sequence[CostmapLayer],
        footprint: Footprint,
        *,
        footprint_padding: float = 0.0,
        frame_id: str = "map",
        rolling_window: bool = False,
        track_unknown_space: bool = False,
        max_age: float = 0.0,
    ) -> None:
        super().__init__()
        self.follows_robot = True
        self.layers: LayerStack[CostmapLayer] = LayerStack(layers)
        self.frame_id = frame_id
        self.rolling_window = rolling_window
        self.max_age = max_age
        geometry = self._preferred_geometry() or geometry
        self._window = CellWindow(geometry, UNKNOWN if track_unknown_space else FREE, frame_id)
        self._footprint_padding = footprint_padding
        self.last_update: float | None = None
        self._after_layers: dict[str, CellArray] | None = None  # cells as each layer has left them; None = not kept
        self._permanent = PermanentLayers()
        self._avoided: tuple[AvoidedPlace, ...] = ()
        self._unmoved: set[str] = set()  # names of layers whose cells are not those of the window, or of their floor
        for layer in layers:
            with making(layer.name):
                layer.match_geometry(geometry)
        self.set_footprint(footprint, passing=())

    # ------------------------------------------------------------------------------------------------ reading
    def snapshot(self) -> Costmap:
        """Read-only copy of the map as of the last update; the same object until the map changes."""
        with self._lock:
            return self._window.snapshot(self.last_update or 0.0)

    def permanent_costmap(self) -> Costmap | None:
        """Costs that the permanent layers alone give, as if no sensor saw anything.

        None on a rolling window, before the first update, without permanent layers, and where another layer may lower
        their costs. The same object until something other than a sensor changes the map.
        """
        with self._lock:
            if self.rolling_window or self.last_update is None:
                return None
            return self._permanent.costmap(list(self.layers.enabled), self._window, self.last_update)

    def costs_after_layers(self, x: float, y: float) -> dict[str, int]:
        """Cost of the cell at (x, y) [m] as each enabled layer has left it, in their order; empty off the map.

        They are kept from the first call on, so they are there after the next update.
        """
        with self._lock:
            if self._after_layers is None:
                self._after_layers = {}
                self._window.compute_all()
            column, row = self.geometry.world_to_cell_unbounded(x, y)
            if not (0 <= column < self.geometry.width and 0 <= row < self.geometry.height):
                return {}
            kept = ((layer.name, self._after_layers.get(layer.name)) for layer in self.layers.enabled)
            return {name: int(cells[row, column]) for name, cells in kept if cells is not None}

    def _keep_cells(self, name: str, cells: CellArray, box: CellBox) -> None:
        """Note what a layer has made of the cells of ``box``, if somebody asks for it."""
        if self._after_layers is None:
            return
        if name not in self._after_layers or box == self.geometry.box:  # after every change of the grid it is all of it
            self._after_layers[name] = cells.copy()
        else:
            self._after_layers[name][box.slices] = cells[box.slices]

    def stale_reason(self, now: float) -> str:
        """Why the map is not current at ``now`` [s]: its age, a layer that raised, a silent sensor; empty if it is."""
        with self._lock:
            if self.layers.problem:
                return self.layers.problem
            if self.last_update is None:
                return "the costmap has not been updated yet"
            age = now - self.last_update
            if 0.0 < self.max_age < age:
                return f"the last update of the costmap is {age:.2f} s old, allowed are {self.max_age:.2f} s"
            return super().stale_reason(now)

    # ----------------------------------------------------------------------------------------------- updating
    def update(self, robot_pose: Pose | None, now: float) -> CellBox:
        """Bring the map up to ``now`` [s] and return the box of cells that were recomputed.

        Parameters
        ----------
        robot_pose : Pose or None
            Pose of the base in ``frame_id``. While it is unknown (None) a rolling window stays where it is, and nothing
            is cleared under the robot.

        Raises
        ------
        ValueError
            The pose is in another frame.
        """
        if robot_pose is not None and robot_pose.frame_id != self.frame_id:
            raise ValueError(f"the robot's pose is in {robot_pose.frame_id!r}, the costmap in {self.frame_id!r}")
        with self._lock:
            self.end_overrides(now)
            self._place_floors()
            for name in sorted(self._unmoved):  # the grid is another one, or a layer raised when the window moved
                with self.layers.computing(self.layers[name]):
                    self.layers[name].match_geometry(self.geometry)
                self._unmoved.discard(name)
            if self.rolling_window and robot_pose is not None:
                self._follow(robot_pose)
            box = self._window.pending
            self._window.compute_all()  # stays so if a layer raises: the next update then repairs everything
            for layer in self.layers.enabled:
                before = box
                with self.layers.computing(layer):
                    box = legal_box(layer.update_bounds(robot_pose, now, box))
                if layer.permanent and before.empty and not box.empty:
                    self._permanent.forget()
            box = box.clipped(self.geometry.box)
            if not box.empty:
                self._recompute(box)
            self._window.pending = EMPTY_BOX
            self.layers.problem = ""
            self.last_update = now
            return EMPTY_BOX if box.empty else box

    def _place_floors(self) -> None:
        """Let layers take up the floors that have come; on another grid all layers begin anew."""
        for layer in self.layers.values():
            with self.layers.computing(layer):
                if layer.place_floor():
                    self.floors_taken += 1
                    self._unmoved.add(layer.name)
                    self._window.forbid_all()
        geometry = self._preferred_geometry()
        if geometry is not None and geometry != self.geometry:
            self._window.geometry = geometry
            self._unmoved |= set(self.layers)
            self._window.forbid_all()

    def _recompute(self, box: CellBox) -> None:
        with self._window.writing(box) as cells:
            for layer in self.layers.enabled:
                with self.layers.computing(layer):
                    layer.update_costs(cells, box)
                self._keep_cells(layer.name, cells, box)
            for place in self._avoided:
                self._window.close_disc((place.centre.x, place.centre.y), place.radius, box)

    def avoid(self, places: Sequence[AvoidedPlace]) -> None:
        """Forbid the robot's centre in these discs, and in no others, from the next update on."""
        with self._lock:
            self._avoided = tuple(places)
            self._window.compute_all()

    def _follow(self, robot_pose: Pose) -> None:
        """Move the window so that the robot is in its middle, and the layers with it."""
        dx, dy = self._window.centre_on(robot_pose)
        if dx == 0 and dy == 0:
            return
        self._unmoved |= set(self.layers)
        for layer in self.layers.values():
            with self.layers.computing(layer):
                layer.shift(self.geometry, dx, dy)
            self._unmoved.discard(layer.name)

    # --------------------------------------------------------------------------------------- changes at run time
    def take_parameters(self, parameters: Any) -> None:
        """Take over outline, padding and ``max_age`` of ``CostmapParameters``."""
        self.set_footprint(parameters.robot_footprint(), parameters.footprint_padding)
        self.max_age = parameters.max_age

    def set_footprint(
        self, footprint: Footprint, padding: float | None = None, passing: tuple[type[Exception], ...] = (ValueError,)
    ) -> None:
        """Replace the robot's outline (given without padding), e.g. when it lifts a load; ``padding`` [m] too if given.

        The next update shows it. LayerListError names a layer that raises anything but errors that are ``passing``.
        """
        with self._lock:
            self._footprint_padding = self._footprint_padding if padding is None else padding
            self.unpadded_footprint, self.footprint = footprint, footprint.padded(self._footprint_padding)
            for layer in self.layers.values():
                with making(layer.name, passing):
                    layer.set_footprint(self.footprint, self.unpadded_footprint)
            self._window.recompute_all()
