"""One hall with a wall and a person in it, as a costmap and as a mesh with the layer ``moving``."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer_list import LayerEntry
from mbf_abstract.maps.sensing import RangeScan
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

PERIOD = 0.1
SENSOR = (5.0, 1.0, 0.5)
WALL_Y = 6.5  # m; a wall along x there, 1 m high
RADIUS = 0.25


def person(x, y, count=24):
    """Points on the side of a person that faces the sensor."""
    towards = math.atan2(SENSOR[1] - y, SENSOR[0] - x)
    angles = towards + np.linspace(-1.4, 1.4, count)
    return np.column_stack([x + RADIUS * np.cos(angles), y + RADIUS * np.sin(angles), np.full(count, 0.5)])


def wall():
    """Points on the wall, with a gap, so that its pieces are as short as people."""
    x = np.concatenate([np.linspace(2.0, 2.6, 12), np.linspace(6.0, 6.8, 16)])
    return np.column_stack([x, np.full(len(x), WALL_Y), np.full(len(x), 0.5)])


@dataclass
class Hall:
    """A map of the hall."""

    name: str
    map: Any
    now: float = 0.0

    def sees(self, *places):
        """Insert a scan of the wall and of people at places, and update the map."""
        self.now = round(self.now + PERIOD, 6)
        points = np.concatenate([wall(), *(person(x, y) for x, y in places)])
        self.map.insert_scan(RangeScan.of_points("lidar", points, SENSOR, self.now))
        self.map.update(Pose.planar(*SENSOR[:2]), self.now)

    def watches(self, x, y, vx, vy, scans=15):
        """Insert scans of a person who walks; return where it is in the last one."""
        for _ in range(scans):
            x, y = x + vx * PERIOD, y + vy * PERIOD
            self.sees((x, y))
        return x, y

    @property
    def objects(self):
        return self.map.tracked_objects(self.now)

    def cost(self, x, y):
        """Cost at a place as a share of that of an obstacle; infinite for an obstacle."""
        if self.name == "costmap":
            cost = self.map.snapshot().cost_at(x, y)
            return math.inf if cost == LETHAL else cost / 253
        costs = self.map.snapshot().costs
        near = np.argmin(np.hypot(self.map.vertices[:, 0] - x, self.map.vertices[:, 1] - y))
        return float(costs[near])


def costmap_hall(rolling=False, **parameters):
    cells = np.zeros((80, 100), dtype=np.uint8)
    cells[round(WALL_Y / 0.1), :] = LETHAL
    moves = {"rolling_window": True, "width": 8.0, "height": 8.0, "resolution": 0.1} if rolling else {}
    entries = [("walls", "static"), ("obstacles", "obstacle"), ("moving", "moving_obstacles")]
    source = {"raytrace_max_range": 0.1, "obstacle_max_range": 10.0, "observation_persistence": 30.0}
    blocks = {
        "obstacles": {"sources": {"lidar": source}, "footprint_clearing_enabled": False},
        "moving": {"sources": ["lidar"], **parameters},
    }
    return build_layered_costmap(
        CostmapParameters(robot_radius=0.2, layers=tuple(LayerEntry(name=n, type=t) for n, t in entries), **moves),
        blocks,
        static_map=Costmap(cells, 0.1),
    )


def mesh_hall(**parameters):
    y = np.repeat(np.arange(81) * 0.1, 101).reshape(81, 101)
    heights = np.where(y > WALL_Y - 0.05, 1.0, 0.0)
    vertices, faces = heightfield_mesh(heights, 0.1, 0.1, 0.0, 0.0, keep_grid=True)
    entries = (
        MeshLayerEntry(name="obstacles", type="obstacle"),
        MeshLayerEntry(name="moving", type="moving_obstacles", inputs=("obstacles",)),
    )
    blocks = {
        "obstacles": {"decay_time": 30.0, "clearing": False},
        "moving": {"sources": ["lidar"], "inscribed_radius": 0.2, **parameters},
    }
    return build_mesh_map(MeshMapParameters(layers=entries), blocks, vertices=vertices, faces=faces)


@pytest.fixture(params=["costmap", "mesh"])
def make_hall(request):
    """Make the map with parameters of the layer ``moving``."""
    build = costmap_hall if request.param == "costmap" else mesh_hall
    return lambda **parameters: Hall(request.param, build(**parameters))


@pytest.fixture
def make_rolling_hall():
    """Make the costmap as one that moves with the robot."""
    return lambda **parameters: Hall("costmap", costmap_hall(rolling=True, **parameters))


@pytest.fixture
def hall(make_hall):
    return make_hall()
