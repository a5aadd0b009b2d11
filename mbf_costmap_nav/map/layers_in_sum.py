"""What the layers of a costmap come to together: what is doubtful about them, and what of them lasts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_costmap_nav.grid.costmap import Costmap, GridGeometry
from mbf_costmap_nav.map.layer import CombinationMethod, CostmapLayer


def warnings_about(layers: LayerStack[CostmapLayer], inscribed_radius: float) -> list[str]:
    """What is legal but hardly meant, of each layer and of all of them, for a robot of ``inscribed_radius`` [m]."""
    warnings = layers.configuration_warnings()
    inflates = any(hasattr(layer.parameters, "inflation_radius") for layer in layers.enabled)
    if layers and not inflates and inscribed_radius > 0.0:
        radius = f"{inscribed_radius:.2f} m"
        warnings.append(f"no inflation layer: grid planners take the robot, of inscribed radius {radius}, for a point")
    return warnings


def lasting_map(
    layers: Sequence[CostmapLayer], geometry: GridGeometry, default_value: int, frame_id: str
) -> Costmap | None:
    """What the lasting layers alone make of a grid, as if no sensor saw anything.

    None where nothing lasts, or where another layer may free what a lasting one forbids.
    """
    lasting = [layer for layer in layers if layer.lasting]
    if not lasting or not all(layer.lasting or _only_adds(layer) for layer in layers):
        return None
    cells = np.full((geometry.height, geometry.width), default_value, dtype=np.uint8)
    for layer in lasting:
        layer.update_costs(cells, geometry.box)
    return Costmap(cells, geometry.resolution, geometry.origin_x, geometry.origin_y, frame_id)


def _only_adds(layer: CostmapLayer) -> bool:
    """Whether a layer never lowers the costs of those before it."""
    overwrite = CombinationMethod.OVERWRITE
    return getattr(layer.parameters, "combination_method", overwrite) is not overwrite
