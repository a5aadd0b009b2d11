"""Layers of a costmap as they are configured: zones and masks, bad configurations, footprints, relaxation."""

import math
from contextlib import nullcontext

import numpy as np
import pytest
import yaml
from PIL import Image
from pydantic import ValidationError

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_costmap_nav.files.map_description import MapError, MapMode
from mbf_costmap_nav.files.map_io import OccupancyMap
from mbf_costmap_nav.files.map_saver import save_map
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from tests.unit.costmap_map.conftest import lethal_cells

HERE = Pose.planar(5.0, 5.0)


ZONE = {"name": "stairs", "polygon": [[2.5, 2.5], [4.5, 2.5], [4.5, 3.5], [2.5, 3.5]], "speed_limit": 0.3}


def test_a_keepout_polygon_is_lethal_and_survives_clearing(build, tmp_path):
    (tmp_path / "zones.yaml").write_text(yaml.safe_dump({"zones": [ZONE]}))
    costmap = build("keepout", keepout={"zones_file": str(tmp_path / "zones.yaml")})
    costmap.clear()
    costmap.update(None, 0.0)
    assert lethal_cells(costmap) == {(x, y) for x in (2, 3, 4) for y in (2, 3)}


def test_a_keepout_mask_of_another_resolution_raises_costs(build, tmp_path):
    occupancy = np.zeros((20, 20), dtype=np.uint8)
    occupancy[4:6, 6:8], occupancy[8:10, 8:10] = 100, 50
    save_map(tmp_path / "mask.yaml", OccupancyMap(occupancy, 0.5), mode=MapMode.SCALE, occupied_thresh=0.6)
    costmap = build("keepout", keepout={"mask_file": str(tmp_path / "mask.yaml")}, rolling_window=True)
    costmap.update(HERE, 0.0)
    snapshot = costmap.snapshot()
    assert (snapshot.cost_at(3.5, 2.5), snapshot.cost_at(4.5, 4.5), snapshot.cost_at(0.5, 0.5)) == (254, 127, 0)


@pytest.mark.parametrize(
    ("limit", "limit_type", "warning"),
    [
        (None, "absolute", "it has no speed_limit, so it does nothing"),
        (100.0, "percent", "a speed_limit of 100 percent is no limit"),
        (99.0, "percent", ""),
        (100.0, "absolute", ""),
    ],
)
def test_a_zone_that_slows_nobody_down_is_noted(build, limit, limit_type, warning):
    block = {"zones": [ZONE | {"speed_limit": limit}], "limit_type": limit_type}
    noted = build("speed_limit", speed_limit=block).layers["speed_limit"].configuration_warning()
    assert noted.endswith(warning) and bool(noted) == bool(warning)


def test_speed_limits_come_from_zones_and_masks(build, tmp_path):
    occupancy = np.full((10, 10), 0, dtype=np.uint8)
    occupancy[8, 8] = 75
    save_map(tmp_path / "mask.yaml", OccupancyMap(occupancy, 1.0), mode=MapMode.SCALE)
    block = {"zones": [ZONE], "mask_file": str(tmp_path / "mask.yaml"), "base": 1.0, "multiplier": -0.01}
    costmap = build("speed_limit", speed_limit=block)
    limits = [costmap.speed_limit(x, y, 1.5) for x, y in ((3.5, 3.0), (8.5, 8.5), (6.5, 6.5), (50.0, 50.0))]
    assert limits == pytest.approx([0.3, 0.25, 1.5, 1.5])
    percent = build("speed_limit", speed_limit={"zones": [ZONE | {"speed_limit": 40.0}], "limit_type": "percent"})
    assert percent.speed_limit(3.5, 3.0, 1.5) == pytest.approx(0.6)


@pytest.mark.parametrize("text", ["zones: [{name: a, polygon: [[0, 0], [1, 1]]}]", "zones: 3", "[", "area: []"])
def test_a_bad_zones_file_is_refused_by_name(build, tmp_path, text):
    (tmp_path / "zones.yaml").write_text(text)
    with pytest.raises(MapError, match=r"zones\.yaml"):
        build("keepout", keepout={"zones_file": str(tmp_path / "zones.yaml")})


# ------------------------------------------------------------------------------------------------ configuration
def test_bad_configurations_are_refused():
    def layers(*entries):
        return CostmapParameters.model_validate({"layers": list(entries)})

    inflation = {"name": "a", "type": "inflation"}
    with pytest.raises(ValueError, match="layer name 'a' is used twice"):
        build_layered_costmap(layers(inflation, inflation))
    with pytest.raises(ValueError, match="inflatoin: unknown type; did you mean 'inflation'"):
        build_layered_costmap(layers({"name": "a", "type": "inflatoin"}))
    with pytest.raises(ValueError, match="parameters for 'b', but no such layer"):
        build_layered_costmap(layers(inflation), {"b": {}})
    with pytest.raises(LayerListError, match="layer 'a': inflation_radius: Input should"):
        build_layered_costmap(layers(inflation), {"a": {"inflation_radius": -1.0}})
    with pytest.raises(ValueError, match="2000 cells"):
        build_layered_costmap(
            CostmapParameters.model_validate({"resolution": 0.05, "layers": [inflation]}),
            {"a": {"inflation_radius": 100.0}},
        )
    with pytest.raises(ValueError, match="needs map_file"):
        build_layered_costmap(layers({"name": "s", "type": "static"}))
    with pytest.raises(ValueError, match="is no CostmapLayer"):
        build_layered_costmap(layers({"name": "a", "type": "pathlib:Path"}))


@pytest.mark.parametrize(
    "size", [{"width": 1e6, "height": 1e6}, {"width": 1e300}, {"width": 900.0, "height": 900.0, "resolution": 1e-4}]
)
def test_a_map_of_absurd_size_is_refused_before_memory_is_taken(size):
    with pytest.raises(ValidationError, match="at most 64000000 cells"):
        CostmapParameters.model_validate(size)


@pytest.mark.parametrize("key", ["origin_x", "origin_y"])
def test_a_map_too_far_away_is_refused(key):
    with pytest.raises(ValidationError, match=rf"(?s){key}.*equal to 1000000000"):
        CostmapParameters.model_validate({key: 1e200})


def test_a_disabled_layer_takes_no_part(build):
    costmap = build("static", static={"enabled": False})
    costmap.update(None, 0.0)
    assert lethal_cells(costmap) == set()


def test_a_larger_footprint_is_inflated_from_the_next_update_on(build):
    costmap = build("static", "inflation", inflation={"inflation_radius": 2.0})
    costmap.update(None, 0.0)
    before = np.count_nonzero(costmap.snapshot().cells == 253)
    costmap.set_footprint(type(costmap.footprint).circle(1.5))
    costmap.update(None, 0.1)
    assert np.count_nonzero(costmap.snapshot().cells == 253) > before
    assert costmap.inscribed_radius == pytest.approx(1.5 * math.cos(math.pi / 16))


@pytest.mark.parametrize("factor", [0.01, 0.5, 0.99])
@pytest.mark.parametrize("inflation_radius", [2.0, 2.5, 4.0])
def test_relaxing_leaves_every_cell_forbidden_on_which_the_robot_would_touch_something(build, inflation_radius, factor):
    block = {"inflation_radius": inflation_radius, "cost_scaling_factor": 0.5}
    costmap = build("static", "inflation", inflation=block, robot_radius=2.4)
    costmap.update(None, 0.0)
    before = costmap.snapshot().cells
    usual = costmap.usual_parameters("inflation")
    costmap.set_layer_parameters("inflation", usual.relaxed(factor, costmap.inscribed_radius), until=5.0)
    costmap.update(None, 1.0)
    relaxed = costmap.snapshot().cells
    assert np.array_equal(relaxed >= 253, before >= 253) and (relaxed <= before).all()
    costmap.update(None, 5.0)
    assert np.array_equal(costmap.snapshot().cells, before)


def test_an_inflation_narrower_than_the_robot_is_widened_and_reported_until_the_robot_is_smaller(build):
    costmap = build("inflation", inflation={"inflation_radius": 0.6}, robot_radius=1.2)
    (warning,) = costmap.configuration_warnings()
    assert warning.startswith("layer 'inflation': inflation_radius 0.6 m is smaller than the inscribed radius")
    costmap.set_footprint(type(costmap.footprint).circle(0.6))
    assert costmap.configuration_warnings() == []


@pytest.mark.parametrize(("radius", "said"), [(0.4, True), (0.6, False), (0.0, False)])
def test_cells_wider_than_the_robot_are_reported(build, radius, said):
    warnings = build(
        "inflation", inflation={"inflation_radius": 1.0}, robot_radius=radius, resolution=1.0
    ).configuration_warnings()
    assert [warning.startswith("cells are 1 m wide, the robot 0.") for warning in warnings] == [True] * said


def test_unknown_cells_are_inflated_only_on_request(build):
    edge = Costmap(np.array([[254, 255, 0, 0, 0, 0]], dtype=np.uint8), 1.0)
    results = []
    for block in ({}, {"inflate_unknown": True}, {"inflate_around_unknown": True}):
        parameters = CostmapParameters.model_validate(
            {"robot_radius": 0.0, "footprint_padding": 0.0, "track_unknown_space": True}
            | {"layers": [{"name": n, "type": n} for n in ("static", "inflation")]}
        )
        block |= {"inflation_radius": 2.0, "cost_scaling_factor": 1.0}
        costmap = build_layered_costmap(parameters, {"inflation": block}, static_map=edge)
        costmap.update(None, 0.0)
        results.append(costmap.snapshot().cells[0].tolist())
    e1, e2 = int(252 * math.exp(-1)), int(252 * math.exp(-2))
    assert results[0] == [254, 255, e2, 0, 0, 0]
    assert results[1] == [254, e1, e2, 0, 0, 0]
    assert results[2][2:] == [e1, e2, 0, 0]


@pytest.mark.parametrize(("free", "reported"), [(0, True), (1, True), (10, False)])
def test_a_map_nearly_all_occupied_is_reported(free, reported):
    cells = np.full((10, 10), 254, dtype=np.uint8)
    cells.flat[:free] = 0
    cells[:, 9] = 255
    parameters = CostmapParameters.model_validate(
        {"robot_radius": 0.0, "layers": [{"name": "walls", "type": "static"}]}
    )
    warnings = build_layered_costmap(parameters, static_map=Costmap(cells, 1.0)).configuration_warnings()
    assert (
        any("of the known cells are occupied, so hardly anything can be planned" in one for one in warnings) == reported
    )


def test_a_robot_on_a_map_without_inflation_is_reported_and_a_point_is_not(build):
    (warning,) = build("static", robot_radius=0.54).configuration_warnings()
    assert warning == "no inflation layer: planners treat the robot, whose inscribed radius is 0.53 m, as a point"
    assert build("static", "inflation", robot_radius=0.54).configuration_warnings() == []
    assert build("static").configuration_warnings() == build(robot_radius=0.54).configuration_warnings() == []


def test_obstacles_behind_the_last_inflation_are_reported_as_nothing_inflates_them(build):
    (warning,) = build("inflation", "static", robot_radius=0.54).configuration_warnings()
    assert "layer 'static' comes behind the last inflation layer" in warning
    assert build("obstacle", "inflation", "speed_limit", robot_radius=0.54).configuration_warnings() == []


@pytest.mark.parametrize(("width", "reported"), [(4.0, True), (8.0, False)])
def test_a_window_smaller_than_the_robot_is_reported(build, width, reported):
    window = {"robot_radius": 3.0, "rolling_window": True, "width": width, "height": 20.0}
    warnings = build("inflation", inflation={"inflation_radius": 3.0}, **window).configuration_warnings()
    text = "the window ends 2 m from the robot's base, but the outline reaches 3 m: what the robot touches"
    assert [one.startswith(text) for one in warnings] == [True] * reported


def test_the_limit_of_cells_is_a_parameter_for_grids_maps_and_masks(tmp_path):
    Image.fromarray(np.full((20, 30), 254, dtype=np.uint8)).save(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text("{image: map.png, resolution: 0.1, origin: [0, 0, 0]}")
    with pytest.raises(ValueError, match="at most 99 cells"):
        CostmapParameters(width=10.0, height=1.0, resolution=0.1, max_cells=99)
    blocks = {"static": {"map_file": "map.yaml"}, "keepout": {"mask_file": "map.yaml"}}
    blocks["speed_limit"] = {"mask_file": "map.yaml"}
    for kind, block in blocks.items():
        for limit in (599, 600):
            parameters = CostmapParameters.model_validate(
                {"width": 1.0, "height": 1.0, "max_cells": limit, "layers": [{"name": "one", "type": kind}]}
            )
            refused = pytest.raises(MapError, match="30 x 20 pixels are more than the limit of 599 cells")
            with refused if limit == 599 else nullcontext():
                build_layered_costmap(parameters, {"one": block}, base_folder=tmp_path)
