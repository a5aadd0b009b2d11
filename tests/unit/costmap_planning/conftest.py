"""Costmap plugins on hand-made maps, without a server."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_costmap_nav.costmap import Costmap, GridGeometry
from mbf_costmap_nav.footprint import Footprint
from mbf_costmap_nav.layered_costmap import LayeredCostmap
from mbf_costmap_nav.plugins import CostmapContext

SQUARE_ROBOT = Footprint([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])


class FixedCostmap(LayeredCostmap):
    """A layered costmap without layers that hands out one fixed grid."""

    def __init__(self, costmap: Costmap, footprint: Footprint = SQUARE_ROBOT):
        self.fixed = costmap
        self.cleared: list[str] = []
        super().__init__(costmap.geometry, [], footprint, frame_id=costmap.frame_id)

    def snapshot(self) -> Costmap:
        return self.fixed

    def clear(self, layer_names=None):
        self.cleared.append("all")
        return []

    def clear_area(self, center_x, center_y, size, *, layer_names=None, inside=False):
        self.cleared.append(f"area {size:g}")
        return []


class ManualClock:
    """Time that only a test moves."""

    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time


class StandingRobot:
    """Robot information with a pose and a velocity that a test sets."""

    def __init__(self) -> None:
        self.pose_now = Pose.planar(0.0, 0.0)
        self.velocity_now = Twist()

    def pose(self) -> Pose:
        return self.pose_now

    def velocity(self) -> Twist:
        return self.velocity_now


@pytest.fixture
def make_plugin() -> Callable[..., Any]:
    """``make_plugin(Class, cells or Costmap, resolution=.., footprint=.., seed=.., **parameters)``."""

    def make(plugin_class, cells, *, resolution=1.0, footprint=SQUARE_ROBOT, seed=0, **parameters):
        grid = cells if isinstance(cells, Costmap) else Costmap(np.asarray(cells, dtype=np.uint8), resolution)
        costmap = FixedCostmap(grid, footprint)
        context = CostmapContext(
            "dut",
            plugin_class.Parameters(**parameters),
            ManualClock(),
            np.random.default_rng(seed),
            StandingRobot(),
            costmap,
            costmap,
            costmap,
        )
        return plugin_class(context)

    return make


@pytest.fixture
def free_grid() -> Callable[..., GridGeometry]:
    """``free_grid(width, height)`` cells of cost 0."""
    return lambda width, height: np.zeros((height, width), dtype=np.uint8)
