"""Layers of others that return what no layer may: refused at once, with the name of the layer."""

import math

import pytest

from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_costmap_nav.grid.costmap import LETHAL, CellBox
from mbf_costmap_nav.layers.inflation import InflationLayer
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.map.layer import CostmapLayer

LAYERS = [{"name": "mine", "type": "foreign"}, {"name": "inflation", "type": "inflation"}]


class ForeignLayer(CostmapLayer):
    """Allows every speed and changes no cell, unless the test wants it otherwise."""

    error: BaseException | None = None
    box: object = "as it is"
    limit: object = 1.0

    def __init__(self, context):
        super().__init__(context)
        if self.error is not None:
            raise self.error

    def update_bounds(self, robot_pose, now, box):
        return box if self.box == "as it is" else self.box

    def update_costs(self, cells, box):
        pass

    def speed_limit(self, x, y, full_speed):
        return self.limit


def costmap_with(**attributes):
    """A map of two layers, the first of which has these attributes."""
    types = {"foreign": type("Foreign", (ForeignLayer,), attributes), "inflation": InflationLayer}
    parameters = CostmapParameters.model_validate({"robot_radius": 0.2, "layers": LAYERS})
    return build_layered_costmap(parameters, load_layer=types.__getitem__)


@pytest.mark.parametrize("error", [KeyError("boom"), SystemExit(3)])
def test_a_layer_that_cannot_be_made_is_named(error):
    with pytest.raises(LayerListError, match=f"layer 'mine' raised {type(error).__name__}"):
        costmap_with(error=error)


def test_a_layer_that_forgets_the_constructor_of_its_base_is_named():
    text = r"layer 'mine' raised TypeError: its __init__ does not call super\(\).__init__\(context\)"
    with pytest.raises(LayerListError, match=text):
        costmap_with(__init__=lambda self, context: None)


@pytest.mark.parametrize("error", [KeyError("boom"), SystemExit(3), ValueError("too wide")])
def test_a_layer_that_takes_no_first_footprint_is_named(error):
    def refusing(self, footprint, unpadded):
        raise error

    with pytest.raises(LayerListError, match=f"layer 'mine' raised {type(error).__name__}"):
        costmap_with(set_footprint=refusing)


@pytest.mark.parametrize("box", [None, (0, 0, 1, 1)])
def test_a_layer_that_returns_no_box_is_named_and_not_the_one_after_it(box):
    costmap = costmap_with(box=box)
    with pytest.raises(TypeError):
        costmap.update(None, 1.0)
    expected = f"layer 'mine' raised TypeError: update_bounds must return a box of cells, got {type(box).__name__}"
    assert costmap.stale_reason(1.0) == expected
    costmap.layers["mine"].box = "as it is"
    costmap.update(None, 2.0)
    assert costmap.stale_reason(2.0) == ""


@pytest.mark.parametrize("limit", [-1.0, math.nan, None])
def test_a_speed_limit_that_is_none_is_no_reason_to_drive_backward(limit):
    costmap = costmap_with(limit=limit)
    with pytest.raises(ValueError, match=f"layer 'mine' gives a speed limit of {limit} m/s, expected 0 or more"):
        costmap.speed_limit(1.0, 1.0, 0.5)
    costmap.layers["mine"].limit = 0.0
    assert costmap.speed_limit(1.0, 1.0, 0.5) == 0.0


@pytest.mark.parametrize("start", [0.5, math.nan])
def test_a_box_of_parts_of_cells_is_its_layers_fault_and_not_that_of_the_first_one_that_writes(start):
    costmap = costmap_with(box=CellBox(start, 0, 1, 1))
    with pytest.raises(TypeError):
        costmap.update(None, 1.0)
    expected = f"layer 'mine' raised TypeError: update_bounds must return a box of whole cells, got ({start}, 0, 1, 1)"
    assert costmap.stale_reason(1.0) == expected


def test_a_robot_too_large_for_the_cells_is_named_and_not_the_layer_that_is_widened_to_it():
    parameters = CostmapParameters(robot_radius=20.0, resolution=0.05, layers=[{"name": "mine", "type": "inflation"}])
    expected = (
        r"^layer 'mine': the robot's inscribed radius is 393 cells of 0.05 m, at most 253 are possible; lengths are"
    )
    with pytest.raises(ValueError, match=expected):
        build_layered_costmap(parameters)


def test_what_an_update_has_not_finished_is_in_the_map_after_the_next():
    class Marking(ForeignLayer):
        """Has one new cell in its first update, and none later."""

        new, fails = True, True

        def update_bounds(self, robot_pose, now, box):
            self.new, new = False, self.new
            return CellBox(3, 4, 4, 5) if new else box

        def update_costs(self, cells, box):
            if self.fails:
                raise OSError("a file is gone")
            if box.x0 <= 3 < box.x1 and box.y0 <= 4 < box.y1:
                cells[4, 3] = LETHAL

    parameters = CostmapParameters.model_validate({"robot_radius": 0.2, "layers": LAYERS[:1]})
    costmap = build_layered_costmap(parameters, load_layer={"foreign": Marking}.__getitem__)
    costmap.layers["mine"].fails = False
    costmap.layers["mine"].new = False
    costmap.update(None, 0.0)
    costmap.layers["mine"].new = costmap.layers["mine"].fails = True
    with pytest.raises(OSError, match="a file is gone"):
        costmap.update(None, 1.0)
    costmap.layers["mine"].fails = False
    costmap.update(None, 2.0)
    assert costmap.snapshot().cells[4, 3] == LETHAL and costmap.stale_reason(2.0) == ""
