"""What a layered costmap asks of its layers, and how they are changed and cleared."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_abstract.maps.view import FloorMap, FloorWindow
from mbf_costmap_nav.grid.costmap import CellBox, GridGeometry
from mbf_costmap_nav.map.cell_window import CellWindow
from mbf_costmap_nav.map.layer import CostmapLayer
from mbf_costmap_nav.map.snapshot_answers import SnapshotAnswers


def legal_box(box: object) -> CellBox:
    """What ``update_bounds`` of a layer has returned; raises TypeError if it is no box of cells."""
    if not isinstance(box, CellBox):
        raise TypeError(f"update_bounds must return a box of cells, got {type(box).__name__}")
    if not all(isinstance(corner, int | np.integer) for corner in box):
        raise TypeError(f"update_bounds must return a box of whole cells, got {tuple(box)}")
    return box


class LayerAnswers(SnapshotAnswers):
    """The part of a ``LayeredCostmap`` that needs no more than its layers and the grid of its cells.

    Attributes
    ----------
    layers : LayerStack
        The layers by name.
    rolling_window : bool
        Whether the grid moves with the robot.
    """

    layers: LayerStack[CostmapLayer]
    rolling_window: bool
    _window: CellWindow

    @property
    def geometry(self) -> GridGeometry:
        """The current grid; it moves with the robot if the window rolls."""
        return self._window.geometry

    def _preferred_geometry(self) -> GridGeometry | None:
        """Grid that a layer wants the map to have; None if none wants one, or the window rolls."""
        wanted = () if self.rolling_window else (layer.preferred_geometry() for layer in self.layers.values())
        return next(filter(None, wanted), None)

    @property
    def map_topics(self) -> tuple[str, ...]:
        """Topics on which layers expect their floor plans, sorted."""
        return tuple(sorted({layer.map_topic for layer in self.layers.values() if layer.map_topic}))

    def take_floor(self, topic: str, floor: FloorMap | FloorWindow) -> None:
        """Hand a floor to the layers that expect it; the next update takes it up. See ``NavigationMap.take_floor``."""
        expecting = [layer for layer in self.layers.values() if layer.map_topic and layer.map_topic == topic]
        if not expecting:
            super().take_floor(topic, floor)
        for layer in expecting:
            layer.take_floor(floor)

    def missing_floor(self) -> str:
        """That of the first enabled layer which misses one."""
        for layer in self.layers.enabled:
            if reason := layer.missing_floor():
                return f"layer {layer.name!r}: {reason}"
        return ""

    def configuration_warnings(self) -> list[str]:
        """What is legal but hardly meant: of each layer, none that inflates, and a window smaller than the robot."""
        with self._lock:
            warnings = [] if self.missing_floor() else super().configuration_warnings()
            inflating = [hasattr(layer.parameters, "inflation_radius") for layer in self.layers.enabled]
            if self.layers and not any(inflating) and self.inscribed_radius > 0.0:
                radius = f"{self.inscribed_radius:.2f} m"
                text = f"no inflation layer: planners treat the robot, whose inscribed radius is {radius}, as a point"
                warnings.append(text)
            for number, layer in enumerate(self.layers.enabled):
                if getattr(layer, "marks_obstacles", False) and any(inflating) and not any(inflating[number:]):
                    text = (
                        f"layer {layer.name!r} comes behind the last inflation layer, which inflates what is before it"
                    )
                    warnings.append(f"{text}: planners treat the robot as a point beside what {layer.name!r} marks")
            warnings += self._size_warnings()
            return warnings

    def _size_warnings(self) -> list[str]:
        """What is suspicious about the sizes of window, cells and robot."""
        grid, robot, warnings = self.geometry, self.footprint, list[str]()
        nearest, reach = 0.5 * grid.resolution * min(grid.width, grid.height), robot.circumscribed_radius
        if self.rolling_window and nearest < reach:
            text = f"the window ends {nearest:.3g} m from the robot's base, but the outline reaches {reach:.3g} m"
            warnings.append(f"{text}: what the robot touches beyond it is not seen; make width and height larger")
        if 0.0 < 2.0 * robot.inscribed_radius < grid.resolution:
            text = f"cells are {grid.resolution:.3g} m wide, the robot {2.0 * robot.inscribed_radius:.3g} m"
            warnings.append(f"{text}: gaps that it fits through look closed; make resolution smaller")
        return warnings

    def speed_limit(self, x: float, y: float, full_speed: float) -> float:
        """Lowest speed [m/s] the layers allow at the point (x, y) [m]; ``full_speed`` where there is no limit.

        Raises ValueError where a layer allows no speed that is one.
        """
        return self.speed_limit_at(Pose.planar(x, y, frame_id=self.frame_id), full_speed)

    # ---------------------------------------------------------------------------------- changing and clearing
    def _replace_parameters(self, name: str, parameters: LayerParameters) -> None:
        """Give a layer its parameters; the effect is visible after the next update, which recomputes everything."""
        layer = self.layers[name]
        old, layer.parameters = layer.parameters, parameters
        self._window.recompute_all()
        try:
            layer.parameters_changed()
        except BaseException:
            layer.parameters = old
            layer.parameters_changed()
            raise

    def clear(self, layer_names: Iterable[str] | None = None) -> list[str]:
        """Reset layers (all by default) to what they know without sensors.

        The effect is visible after the next update. Returned are the names of the layers that hold what is sensed, and
        of a floor plan where it is asked for. Raises KeyError where a name is no layer.
        """
        with self._lock:
            for layer in self.layers.forgetting(layer_names):
                layer.reset()
            self._window.recompute_all()
            return [layer.name for layer in self._clearable(layer_names)]

    def clear_area(
        self, center: Pose, size: float, layer_names: Iterable[str] | None = None, *, inside: bool = True
    ) -> list[str]:
        """Clear layers inside, or outside, a square window of side ``size`` [m] around a pose; return their names.

        By default these are the layers that sensors fill again (``CostmapLayer.clearable``), not the floor plan. A
        static layer that is named loses the area until ``clear``. Raises KeyError where a name is no layer.
        """
        with self._lock:
            chosen = self._clearable(layer_names)
            x0, y0 = self.geometry.world_to_cell_unbounded(center.x - size / 2, center.y - size / 2)
            x1, y1 = self.geometry.world_to_cell_unbounded(center.x + size / 2, center.y + size / 2)
            window = CellBox(x0 + 1, y0 + 1, x1, y1)  # costmap_2d's window leaves out its border cells
            for layer in chosen:
                layer.clear_area(window, inside)
            self._window.recompute_all()
        return [layer.name for layer in chosen]

    def _clearable(self, layer_names: Iterable[str] | None) -> list[CostmapLayer]:
        """Layers of some names that forget when they are cleared; by default without the floor plans."""
        forgetting = self.layers.forgetting(layer_names)
        return [layer for layer in forgetting if layer.clearable or layer_names is not None]
