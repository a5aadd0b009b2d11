"""Every installed layer keeps the contract of layers, and layers that break it are caught."""

import numpy as np
import pytest

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.testing.contract import ContractBroken, check_layer
from mbf_costmap_nav.grid.costmap import CellBox
from mbf_costmap_nav.map.layer import CombinationMethod, CostmapLayer, GridLayer, combine
from mbf_mesh_nav.layers.border import BorderLayer
from mbf_mesh_nav.layers.steepness import SteepnessLayer
from mbf_mesh_nav.map.layer import LayerContext, MeshLayer
from mbf_mesh_nav.map.mesh_map import MeshMap

CORNERS = [(1.0, 1.0), (2.5, 1.0), (2.5, 2.0), (1.0, 2.0)]
SOURCES = {"sources": {"laser": {"observation_persistence": 5.0}}}
COSTMAP_PARAMETERS = {
    "keepout": {"zones": [{"name": "stairs", "polygon": CORNERS}]},
    "speed_limit": {"zones": [{"name": "school", "polygon": CORNERS, "speed_limit": 0.3}]},
    "obstacle": SOURCES,
    "voxel": SOURCES,
    "range_sensor": {"sources": {"laser": {}}},
    "moving_obstacles": {"sources": ["laser"]},
}
MESH_PARAMETERS = {
    "clearance": {"robot_height": 0.8},
    "keepout": {"regions": [{"polygon": CORNERS}]},
    "label": {"regions": [{"polygon": CORNERS, "label": "mud"}], "label_costs": {"mud": 0.4}},
    "obstacle": {"decay_time": 10.0},
    "speed_limit": {"regions": [{"polygon": CORNERS, "speed_limit": 0.3}]},
    "moving_obstacles": {"sources": ["sensor"]},
}
SCAN = RangeScan.of_rays("laser", (3.5, 2.0, 0.3), [(4.5, 2.0, 0.3), (3.5, 3.0, 0.5), (2.5, 2.4, 0.3)], [True] * 3, 0.9)
CLOUD = np.array([(1.5, 1.5, 0.9), (1.6, 1.5, 0.9), (2.2, 0.7, 0.8)])


def installed(backend):
    """All layer types of a backend."""
    return PluginRegistry(backend).names(f"{backend}_layers")


@pytest.fixture(scope="module")
def hill():
    """Ground of 3 m x 3 m with a step and a hill."""
    x, y = np.meshgrid(np.arange(31) * 0.1, np.arange(31) * 0.1)
    return MeshMap.from_heights(0.4 * np.exp(-((x - 1.5) ** 2 + (y - 1.5) ** 2)) + 0.3 * (x > 2.5), 0.1, 0.1)


def computed(layer_class, mesh_map, name):
    layer = layer_class(LayerContext(name, mesh_map.topology, mesh_map.locator, layer_class.Parameters()))
    layer.recompute()
    return layer


@pytest.mark.parametrize("name", installed("mesh"))
def test_mesh_layer(name, hill):
    layer_class = PluginRegistry("mesh").load("mesh_layers", name, MeshLayer)
    sources = [computed(BorderLayer, hill, "border"), computed(SteepnessLayer, hill, "steepness")]
    check_layer(
        layer_class,
        hill,
        parameters=layer_class.Parameters.model_validate(MESH_PARAMETERS.get(name, {})),
        inputs=sources[: layer_class.inputs_allowed[1]],
        points=CLOUD,
        sensor_origin=(0.2, 0.2, 1.0),
    )


@pytest.mark.parametrize("name", installed("costmap"))
def test_costmap_layer(name):
    layer_class = PluginRegistry("costmap").load("costmap_layers", name, CostmapLayer)
    parameters = layer_class.Parameters.model_validate(COSTMAP_PARAMETERS.get(name, {}))
    check_layer(layer_class, parameters=parameters, scans=[SCAN])


class GoodMeshLayer(MeshLayer):
    """Cost 0.5 everywhere, until points are seen; each bad layer breaks one rule of it."""

    inputs_allowed = (1, 1)
    seen = False
    waiting = None

    def compute(self):
        return np.full_like(self._costs, 1.0 if self.seen else 0.5), np.zeros_like(self._lethal)

    def insert_scan(self, scan):
        self.waiting = scan

    def update(self, now):
        self.seen = self.waiting is not None and self.waiting.hits.any()
        return self.recompute()

    def clear(self):
        self.seen, self.waiting = False, None
        return self.recompute()


class NanCosts(GoodMeshLayer):
    def compute(self):
        return np.full_like(self._costs, np.nan), self._lethal


class DoubleCosts(GoodMeshLayer):
    def compute(self):
        return np.zeros(len(self._costs)), self._lethal


class RandomCosts(GoodMeshLayer):
    def compute(self):
        return np.random.default_rng().random(len(self._costs), np.float32), self._lethal


class GrowingCosts(GoodMeshLayer):
    def compute(self):
        return self._costs + np.float32(0.1), self._lethal


class NeverClears(GoodMeshLayer):
    def clear(self):
        return self.recompute()


class WrongChanges(GoodMeshLayer):
    def recompute(self):
        return super().recompute()[:3]


class WritesItsInput(GoodMeshLayer):
    def compute(self):
        self.inputs[0]._costs += 1.0
        return super().compute()


class NeedsItsOwnParameters(GoodMeshLayer):
    def __init__(self, context):
        super().__init__(context)
        self.first = context.parameters

    def compute(self):
        costs, lethal = super().compute()
        return costs if self.parameters is self.first else costs * 2.0, lethal


def check_with_an_input(layer_class, mesh_map):
    source = computed(BorderLayer, mesh_map, "border")
    check_layer(layer_class, mesh_map, inputs=[source], points=CLOUD)


def test_a_mesh_layer_that_keeps_the_contract_passes(hill):
    check_with_an_input(GoodMeshLayer, hill)


@pytest.mark.parametrize(
    ("layer_class", "text"),
    [
        (NanCosts, "961 costs are NaN or negative, e.g. nan at vertex 0"),
        (DoubleCosts, "costs are float64 (961,), expected float32 (961,)"),
        (RandomCosts, "recompute: two instances have different values"),
        (GrowingCosts, "a second recompute changed the values"),
        (NeverClears, "clear did not bring back the state without sensors"),
        (WrongChanges, "the vertices it returned are not those that changed"),
        (WritesItsInput, "it changed an array it was only shown"),
        (NeedsItsOwnParameters, "the same parameters, set at run time, gave other values"),
    ],
)
def test_a_bad_mesh_layer_is_caught(layer_class, text, hill):
    with pytest.raises(ContractBroken, match=f"^{layer_class.__name__} breaks") as broken:
        check_with_an_input(layer_class, hill)
    assert text in str(broken.value)


def test_a_mesh_layer_without_its_inputs_is_a_mistake_of_the_caller(hill):
    with pytest.raises(ValueError, match="GoodMeshLayer takes 1 to 1 inputs, got 0"):
        check_layer(GoodMeshLayer, hill)


class GoodCostmapLayer(GridLayer):
    """Raises free cells left of what was seen; each bad layer breaks one rule of it."""

    source_names = ("laser",)
    moved = False

    def insert_scan(self, scan):
        columns = int((scan.ends[:, 0].max() - self.geometry.origin_x) / self.geometry.resolution)
        self.cells[:, : max(0, columns)] = 50
        self.moved = True

    def update_bounds(self, robot_pose, now, box):
        moved, self.moved = self.moved, False
        return box.union(self.geometry.box) if moved else box

    def update_costs(self, cells, box):
        combine(cells, self.cells, box, CombinationMethod.MAXIMUM)


class WritesEverywhere(GoodCostmapLayer):
    def update_costs(self, cells, box):
        cells[:] = 7


class ForgetsTheBox(GoodCostmapLayer):
    def update_bounds(self, robot_pose, now, box):
        return CellBox(3, 3, 5, 5)


class SmallBox(GoodCostmapLayer):
    def update_bounds(self, robot_pose, now, box):
        return box


class CountsUpdates(GoodCostmapLayer):
    def update_costs(self, cells, box):
        self.cells[:] = self.cells % 100 + 1
        super().update_costs(cells, box)


class RandomCells(GoodCostmapLayer):
    def update_costs(self, cells, box):
        part = cells[box.slices]
        part[:] = np.random.default_rng().integers(0, 100, part.shape)


class InventsUnknownSpace(GoodCostmapLayer):
    def update_costs(self, cells, box):
        cells[box.slices] = 255


class NeverResets(GoodCostmapLayer):
    def reset(self):
        pass


class Raises(GoodCostmapLayer):
    def update_costs(self, cells, box):
        raise RuntimeError("no map")


class IgnoresTheNewGrid(GoodCostmapLayer):
    def shift(self, geometry, dx, dy):
        pass


class StaysBehind(GoodCostmapLayer):
    def shift(self, geometry, dx, dy):
        self.geometry = geometry


class WrapsAround(GoodCostmapLayer):
    def shift(self, geometry, dx, dy):
        self.geometry = geometry
        self.cells = np.roll(self.cells, (-dy, -dx), (0, 1))


class NeverClearsAnArea(GoodCostmapLayer):
    def clear_area(self, box, inside):
        pass


class ClearsTooMuch(GoodCostmapLayer):
    def clear_area(self, box, inside):
        self.reset()


class MovesTheHits(GoodCostmapLayer):
    def insert_scan(self, scan):
        super().insert_scan(scan)
        scan.ends[0, 0] += 0.1


def test_a_costmap_layer_that_keeps_the_contract_passes():
    check_layer(GoodCostmapLayer, scans=[SCAN])


@pytest.mark.parametrize(
    ("layer_class", "text"),
    [
        (WritesEverywhere, "part update: wrote outside its box"),
        (ForgetsTheBox, "first update: update_bounds gave up cells of its box"),
        (SmallBox, "update_bounds returned a box that misses changed cells"),
        (CountsUpdates, "second update: cells changed although nothing else had"),
        (RandomCells, "first update: two instances wrote different cells"),
        (InventsUnknownSpace, "wrote 255 (unknown) into a map without unknown space"),
        (NeverResets, "reset did not bring back the state without sensors"),
        (Raises, "updating: raised RuntimeError: no map (update_costs:"),
        (IgnoresTheNewGrid, "shift: the layer did not take over the new grid"),
        (StaysBehind, "shift: cells changed that stayed in the window"),
        (WrapsAround, "shift: what left the window was not forgotten"),
        (NeverClearsAnArea, "clear_area(inside=True): the area still shows what was seen there"),
        (ClearsTooMuch, "clear_area(inside=False): cells out of the area changed"),
        (MovesTheHits, "it changed an array it was only shown"),
    ],
)
def test_a_bad_costmap_layer_is_caught(layer_class, text):
    scan = RangeScan.of_rays(SCAN.source, SCAN.origin, SCAN.ends, SCAN.hits, SCAN.stamp)
    with pytest.raises(ContractBroken, match=f"^{layer_class.__name__} breaks") as broken:
        check_layer(layer_class, scans=[scan])
    assert text in str(broken.value)


@pytest.mark.parametrize("no_layer", [dict, PluginRegistry, 5])
def test_what_is_no_layer_is_refused(no_layer):
    with pytest.raises(TypeError, match="is not a layer: expected a class with contract_check"):
        check_layer(no_layer)
