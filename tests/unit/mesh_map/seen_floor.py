"""A level floor with a layer that senses obstacles and its inflation, and what a sensor sees there."""

import numpy as np

from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

SENSOR = [0.0, 2.0, 0.5]


def see(mesh: MeshMap, points: object, stamp: float, origin: object = SENSOR, source: str = "cloud") -> None:
    """Insert a cloud and update the map at its stamp."""
    mesh.insert_points(source, points, origin, stamp)
    mesh.update(None, stamp)


def floor_map(storeys: int = 1, **obstacle: object) -> MeshMap:
    vertices, faces = heightfield_mesh(np.zeros((21, 21)), 0.2, 0.2)
    parameters = MeshMapParameters(
        layers=[
            {"name": "seen", "type": "obstacle"},
            {"name": "inflation", "type": "inflation", "inputs": ["seen"]},
        ],
        edge_cost_factor=2.0,
    )
    lifted = [vertices + np.array([0.0, 0.0, 2.5 * storey]) for storey in range(storeys)]
    corners = [faces + storey * len(vertices) for storey in range(storeys)]
    inflation = {"inflation_radius": 0.5, "lethal_value": np.inf}
    blocks = {"seen": obstacle, "inflation": inflation}
    return build_mesh_map(parameters, blocks, vertices=np.vstack(lifted), faces=np.vstack(corners))


def post(x: float, y: float, low: float = 0.1, high: float = 0.9) -> np.ndarray:
    z = np.linspace(low, high, 9)
    return np.column_stack([np.full(9, x), np.full(9, y), z])
