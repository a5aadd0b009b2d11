"""The interface of a mesh layer: one cost and one lethal flag per vertex, recomputed when its inputs change.

A new layer derives ``MeshLayer``, declares ``Parameters`` and writes ``compute``. Layers that can do better than
starting over after a local change override ``update_from_inputs``; layers fed by a sensor override ``insert_scan``,
``update``, ``clear`` and ``stale_reason``. A layer never calls another layer: the layer graph hands changes on.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from mbf_abstract.maps.layers import layer as map_layer
from mbf_abstract.parameters import parameter
from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.mesh.locate import SurfaceLocator
from mbf_mesh_nav.mesh.topology import MeshTopology

CostArray = Float32Array
LethalArray = BoolArray

NOTHING_CHANGED: IntArray = np.zeros(0, dtype=np.int32)


class LayerParameters(map_layer.LayerParameters):
    """Parameters every mesh layer has."""

    combination_weight: float = parameter(1.0, "Weight of this layer in a weighted sum or mean.", ge=0.0, le=10.0)

    def for_radius(self, old: float, new: float) -> Self:
        """Return these for a robot whose inscribed radius [m] changes; themselves where the layer knows no robot.

        ``old`` is that of the map, 0 = unknown. Raises ValueError where they would not be legal.
        """
        return self


@dataclass(frozen=True, eq=False)
class LayerContext:
    """What a layer is constructed with.

    Attributes
    ----------
    name : str
        Name of the instance in the configuration.
    topology, locator
        The mesh and its surface queries.
    parameters : LayerParameters
        Validated instance of the layer class's ``Parameters``.
    inputs : tuple of MeshLayer
        The layers it reads, in the configured order.
    frame_id : str
        Frame of all coordinates.
    height_errors : (V,) float64, optional
        Standard errors of the heights of the vertices [m]; None = the map does not state them vertex by vertex.
    place_errors : (V,) float64, optional
        Those of places on the faces around the vertices [m]; None = as those of the vertices.
    """

    name: str
    topology: MeshTopology
    locator: SurfaceLocator
    parameters: LayerParameters
    inputs: tuple[MeshLayer, ...] = ()
    frame_id: str = "map"
    height_errors: FloatArray | None = None
    place_errors: FloatArray | None = None


class MeshLayer(map_layer.MapLayer):
    """One attribute of the surface: cost (V,) float32 and lethal (V,) bool.

    Attributes
    ----------
    costs, lethal
        Read-only views of the current values; a missing value is +inf (lethal) rather than NaN.
    """

    Parameters: ClassVar[type[LayerParameters]] = LayerParameters
    inputs_allowed: ClassVar[tuple[int, int]] = (0, 0)
    """Least and greatest number of inputs."""
    cacheable: ClassVar[bool] = False
    """Whether the values depend on mesh and parameters alone and are worth keeping in a file."""
    has_costs: ClassVar[bool] = True
    """Whether it says where to plan; without costs it is no default layer unless it is named as such."""
    unit: ClassVar[str] = ""
    """Unit of the costs, such as rad; empty = a share, or a sum of several units."""
    contract_check: ClassVar[str] = "mbf_mesh_nav.testing:check_layer"

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context.name, context.parameters)
        self.topology = context.topology
        self.locator = context.locator
        self.inputs = context.inputs
        self.height_errors = context.height_errors
        self.place_errors = context.height_errors if context.place_errors is None else context.place_errors
        self._costs: CostArray = np.zeros(context.topology.vertex_count, dtype=np.float32)
        self._lethal: LethalArray = np.zeros(context.topology.vertex_count, dtype=np.bool_)

    @property
    def costs(self) -> CostArray:
        """Costs (V,) float32 in internal numbering, a read-only view."""
        return _read_only(self._costs)

    @property
    def lethal(self) -> LethalArray:
        """Lethal mask (V,) bool in internal numbering, a read-only view."""
        return _read_only(self._lethal)

    @property
    def lethal_for_good(self) -> LethalArray:
        """Read-only (V,) bool: what is lethal however exact the map is, without what a margin for errors closes."""
        return self.lethal

    @classmethod
    def reach(cls, parameters: Any) -> float:
        """How far [m] from a vertex lies whatever its values depend on, besides the faces around it; inf = unknown.

        A map of tiles computes the layers of each tile on the tile and what lies within this distance around it.
        """
        return math.inf

    def lethal_reason(self, vertex: int) -> str:
        """Why a vertex is lethal, for a user who wonders; empty if there is nothing to say. Called on any thread."""
        limit = getattr(self.parameters, "threshold", None)
        if limit is None:
            return ""
        cost, unit = float(self.costs[vertex]), f" {self.unit}" if self.unit else ""
        narrowed = "" if cost > limit else ", lowered for the error of the map's heights"
        return f"{cost:.3g}{unit}, threshold {limit:g}{unit}{narrowed}"

    @abstractmethod
    def compute(self) -> tuple[CostArray, LethalArray]:
        """Compute costs (V,) float32 and lethal flags (V,) bool anew from mesh, parameters and inputs."""

    def recompute(self) -> IntArray:
        """Compute everything anew and return the vertices (k,) int32 whose cost or flag changed, ascending."""
        if self.parameters.enabled:
            values: Any = self.compute()
            if not (isinstance(values, tuple) and len(values) == 2):
                raise TypeError(f"compute must return costs and lethal flags, a tuple, got {type(values).__name__}")
            return self.replace(*values)
        count = self.topology.vertex_count
        return self.replace(np.zeros(count, dtype=np.float32), np.zeros(count, dtype=np.bool_))

    def replace(self, costs: CostArray, lethal: LethalArray) -> IntArray:
        """Take over costs (V,) and lethal flags (V,) and return the vertices (k,) int32 that changed, ascending.

        Values of other types are converted: a flag is any number but 0, a cost that is NaN is missing.

        Raises
        ------
        ValueError
            There is not one value for each vertex.
        TypeError
            The values are no numbers.
        """
        costs, lethal = self._legal("costs", costs, np.float32), self._legal("lethal flags", lethal, np.bool_)
        if np.isnan(costs.min(initial=np.inf)):  # NaN where any cost is; a mask of all takes longer
            costs = np.where(np.isnan(costs), np.float32(np.inf), costs)
        changed = np.flatnonzero((costs != self._costs) | (lethal != self._lethal)).astype(np.int32)
        self._costs, self._lethal = costs, lethal
        return changed

    def _legal(self, what: str, values: Any, dtype: type[np.generic]) -> NDArray[Any]:
        """One number for each vertex, of this type; the array itself where it is so already."""
        array, expected = np.asarray(values), (self.topology.vertex_count,)
        if array.shape != expected:
            raise ValueError(f"layer '{self.name}' gives {what} of shape {array.shape}, expected {expected}")
        if array.dtype.kind not in "biuf":
            raise TypeError(f"layer '{self.name}' gives {what} of type {array.dtype}, expected {np.dtype(dtype)}")
        return array.astype(dtype, copy=False)

    def take_over(self, old: MeshLayer) -> None:
        """Know what a layer of the same class has sensed on another part of the same surface, before ``compute``.

        Called for a map whose part in memory follows the robot. What lies off this part is forgotten. The old layer
        takes no update any more, but may still be given a scan by another thread: it is to end up here. A layer that
        does not override this knows nothing until its next scan.
        """

    def update_from_inputs(self, changed: IntArray) -> IntArray:
        """React to changed vertices (j,) int32 of the inputs; return the own ones (k,) int32 that changed."""
        return self.recompute() if len(changed) else NOTHING_CHANGED

    def update(self, now: float) -> IntArray:
        """Take in scans since the last update, forget what is too old at ``now`` [s]; return changed vertices (k,)."""
        return NOTHING_CHANGED

    @property
    def forgets(self) -> bool:
        """Whether ``clear`` is its own."""
        return type(self).clear is not MeshLayer.clear

    def clear(self) -> IntArray:
        """Forget everything sensed; return the vertices (k,) int32 that changed, ascending."""
        return NOTHING_CHANGED

    def clear_area(self, center: FloatArray, size: float, inside: bool) -> IntArray:
        """Forget what was sensed in, or out of, a square of side ``size`` [m] around a place (3,): ``in_square``."""
        return NOTHING_CHANGED


def in_square(points: FloatArray, center: FloatArray, size: float, height: float) -> BoolArray:
    """Which points (n, 3) [m] lie in a square of side ``size`` [m] around a place (3,) on the ground, seen from above.

    They are no farther above or below it than ``height`` [m], or half of the side where that is more: hits of a sensor
    are up to a robot's height above the ground, and the ground in the square may slope.
    """
    reach = np.array([0.5 * size, 0.5 * size, max(0.5 * size, height)])
    return np.asarray((np.abs(points - center) <= reach).all(axis=1))


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    view = array.view()
    view.flags.writeable = False
    return view
