"""Inflation layer: costs that decay with the distance to the nearest lethal cell.

The rule is costmap_2d's: 254 at the obstacle; 253 up to the inscribed radius (the robot's centre there means contact
whatever its heading); beyond it int(252 * exp(-cost_scaling_factor * (distance - inscribed_radius))); nothing beyond
the inflation radius, which is rounded up to whole cells and is never less than the inscribed radius: cells the robot
cannot stand on never count as free. Distances are exact Euclidean ones between cell centres.

When to use: after all layers that mark obstacles, in every map a planner works on. Layers listed after it are not
inflated. When not: for pure length or any-angle tests, where a gradient of cost bends the paths. Cost: 1 to 2 ns a cell
at 11 cells of radius, growing with the radius; only the changed box, grown by the radius, is recomputed. Known
failure: a large ``cost_scaling_factor`` makes paths hug walls, a radius smaller than half the width of a corridor
leaves its middle without a gradient.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.inflation import InflationRadii
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.grid.costmap import FREE, INSCRIBED, LETHAL, UNKNOWN, CellArray, CellBox, GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.map.inflation import LARGEST_RADIUS, inflate
from mbf_costmap_nav.map.layer import CostmapLayer, LayerContext


class InflationLayerParameters(LayerParameters, InflationRadii):
    """Parameters of the inflation layer."""

    inflation_radius: float = parameter(0.55, "Distance from obstacles with a cost.", unit="m", ge=0.0, le=100.0)
    cost_scaling_factor: float = parameter(10.0, "Rate of decay beyond the inscribed radius.", unit="1/m", ge=0.0)
    inflate_unknown: bool = parameter(False, "Let any cost replace unknown cells, not only the inscribed one.")
    inflate_around_unknown: bool = parameter(False, "Treat unknown cells as obstacles to keep away from.")


class InflationLayer(CostmapLayer):
    """Distance costs around lethal cells. See the module's text for when to use it."""

    Parameters = InflationLayerParameters
    parameters: InflationLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._inscribed_radius = 0.0
        self._radius = 0
        self._cost_of_square: NDArray[np.uint8] = np.array([LETHAL], dtype=np.uint8)
        self._seeds: NDArray[np.uint8] = np.zeros((0, 0), dtype=np.uint8)

    def match_geometry(self, geometry: GridGeometry) -> None:
        """Allocate the seeds and the cost table."""
        super().match_geometry(geometry)
        self._seeds = np.zeros((geometry.height, geometry.width), dtype=np.uint8)
        self._tabulate()

    def set_footprint(self, footprint: Footprint, unpadded: Footprint) -> None:
        """Take over the inscribed radius."""
        self._inscribed_radius = footprint.inscribed_radius
        self._tabulate()

    def parameters_changed(self) -> None:
        """Make the cost table for the new radius and decay."""
        self._tabulate()

    @property
    def permanent(self) -> bool:
        """Whether it inflates no unknown cells; its costs are as permanent as those it inflates."""
        return not self.parameters.inflate_around_unknown

    def configuration_warning(self) -> str:
        """Warn that the radius is smaller than the inscribed radius and was widened."""
        radius = self.parameters.inflation_radius
        if radius >= self._inscribed_radius:
            return ""
        return (
            f"inflation_radius {radius:g} m is smaller than the inscribed radius of the footprint and widened to it, "
            f"{self._inscribed_radius:g} m: else cells the robot cannot stand on would look free"
        )

    def _tabulate(self) -> None:
        radius = max(self.parameters.inflation_radius, self._inscribed_radius)
        self._radius = math.ceil(radius / self.geometry.resolution)
        if self._radius > LARGEST_RADIUS:
            of_robot = radius > self.parameters.inflation_radius
            name = "the robot's inscribed radius" if of_robot else "inflation_radius"
            raise LayerListError(
                f"layer {self.name!r}: {name} is {self._radius:g} cells of {self.geometry.resolution:g} m, "
                f"at most {LARGEST_RADIUS} are possible; lengths are in metres"
            )
        self._cost_of_square = cost_table(
            self._radius, self.geometry.resolution, self._inscribed_radius, self.parameters.cost_scaling_factor
        )

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Grow the box by the radius: a new obstacle changes costs that far away."""
        return box.grown(self._radius)

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Inflate the lethal cells the layers before left in the box, and those remembered around it.

        Cells outside the box already hold later layers' costs and must not be inflated, so the seeds are kept
        separately.
        """
        window = cells[box.slices]
        seeds = window == LETHAL
        if self.parameters.inflate_around_unknown:
            seeds |= window == UNKNOWN
        self._seeds[box.slices] = seeds
        unknown_from = FREE + 1 if self.parameters.inflate_unknown else INSCRIBED
        inflate(cells, self._seeds, box, self._cost_of_square, self._radius, unknown_from)


def cost_table(
    radius: int, resolution: float, inscribed_radius: float, cost_scaling_factor: float
) -> NDArray[np.uint8]:
    """(radius^2 + 1,) uint8, cost by squared distance in cells.

    Parameters
    ----------
    radius : int
        Inflation radius [cells].
    resolution : float
        Side of a cell [m].
    inscribed_radius : float
        Up to this distance [m] the cost is 253.
    cost_scaling_factor : float
        Rate of decay [1/m] beyond it.
    """
    distances = np.sqrt(np.arange(radius * radius + 1, dtype=np.float64)) * resolution
    beyond = np.maximum(distances - inscribed_radius, 0.0)
    # math.exp, because numpy's own can be one bit off, and the truncation makes a cost of that.
    decay = np.array([math.exp(-cost_scaling_factor * distance) for distance in beyond.tolist()])
    table = ((INSCRIBED - 1) * decay).astype(np.uint8)
    table[distances <= inscribed_radius] = INSCRIBED
    table[0] = LETHAL
    return table
