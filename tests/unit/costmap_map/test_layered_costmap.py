"""The layered costmap: update windows, the rolling window, snapshots, clearing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import FREE, LETHAL, UNKNOWN, CellBox, Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from tests.unit.costmap_map.conftest import lethal_cells

HERE = Pose.planar(5.0, 5.0)


# --------------------------------------------------------------------------------------------- update windows
LAYERS = ("obstacle", "denoise", "inflation", "keepout")


def with_windows(seeing):
    """A map whose last layer comes after the inflation and so must not be inflated."""
    laser = seeing["sources"]["laser"] | {"observation_persistence": 0.0}
    parameters = CostmapParameters.model_validate(
        {
            "resolution": 1.0,
            "width": 20.0,
            "height": 15.0,
            "robot_radius": 0.0,
            "footprint_padding": 0.0,
            "layers": [{"name": name, "type": name} for name in LAYERS],
        }
    )
    blocks = {
        "obstacle": seeing | {"sources": {"laser": laser}},
        "denoise": {"minimal_group_size": 3, "group_connectivity_type": 4},
        "inflation": {"inflation_radius": 2.0, "cost_scaling_factor": 0.5},
        "keepout": {"zones": [{"name": "door", "polygon": [[15.5, 3.5], [16.5, 3.5], [16.5, 4.5]]}]},
    }
    return build_layered_costmap(parameters, blocks)


SCANS = st.lists(
    st.lists(st.tuples(st.floats(0.1, 19.9), st.floats(0.1, 14.9)), min_size=1, max_size=8), min_size=1, max_size=5
)


@given(SCANS)
@settings(max_examples=30, deadline=None)
def test_updating_changed_boxes_gives_the_same_map_as_updating_everything(scans):
    laser = {"obstacle_max_range": 50.0, "raytrace_max_range": 50.0, "expected_update_rate": 0.0}
    by_boxes, at_once = (
        with_windows({"footprint_clearing_enabled": False, "sources": {"laser": laser}}) for _ in range(2)
    )
    by_boxes.update(None, 0.0)
    for stamp, points in enumerate(scans):
        for costmap in (by_boxes, at_once):
            costmap.insert_points("laser", [(*p, 0.0) for p in points], (10.0, 7.0, 0.0), float(stamp))
        box = by_boxes.update(None, float(stamp))
        at_once.set_footprint(at_once.unpadded_footprint)  # recomputes every cell
        assert at_once.update(None, float(stamp)) == at_once.geometry.box
        assert np.array_equal(by_boxes.snapshot().cells, at_once.snapshot().cells), box


def test_only_the_box_around_a_change_is_recomputed(build, seeing):
    costmap = build("obstacle", obstacle=seeing, width=50.0, height=50.0)
    costmap.update(None, 0.0)
    costmap.insert_points("laser", [(12.5, 10.5, 0.0)], (10.5, 10.5, 0.0), 0.0)
    assert costmap.update(None, 0.1) == CellBox(10, 10, 13, 11)


def test_nothing_new_recomputes_nothing_and_keeps_the_snapshot(build):
    costmap = build("static", "inflation")
    assert costmap.update(None, 0.0) == costmap.geometry.box
    snapshot = costmap.snapshot()
    assert costmap.update(None, 1.0).empty
    assert costmap.snapshot() is snapshot


def test_a_snapshot_is_read_only_and_keeps_its_content(build, seeing):
    costmap = build("obstacle", obstacle=seeing)
    before = costmap.snapshot()
    costmap.insert_points("laser", [(5.0, 5.0, 0.0)], (0.0, 0.0, 0.0), 0.0)
    costmap.update(None, 0.0)
    assert before.cost(5, 5) == FREE and costmap.snapshot().cost(5, 5) == LETHAL
    assert costmap.snapshot().version > before.version
    with pytest.raises(ValueError, match="read-only"):
        before.cells[0, 0] = 1


# --------------------------------------------------------------------------------------------- rolling window
@pytest.fixture
def rolling(build, seeing):
    seeing["sources"]["laser"]["observation_persistence"] = 0.0
    return build("obstacle", obstacle=seeing, rolling_window=True, width=10.0, height=6.0, track_unknown_space=True)


def test_a_rolling_window_keeps_the_robot_in_its_middle(rolling):
    rolling.update(Pose.planar(103.2, -7.9), 0.0)
    snapshot = rolling.snapshot()
    assert (snapshot.origin_x, snapshot.origin_y) == (98.0, -11.0)
    assert snapshot.world_to_cell(103.2, -7.9) == (5, 3)


def test_marks_stay_where_they_are_in_the_world_while_the_window_moves(rolling):
    rolling.update(Pose.planar(0.0, 0.0), 0.0)
    rolling.insert_points("laser", [(2.5, 1.5, 0.0)], (0.0, 0.0, 0.0), 0.0)
    rolling.update(Pose.planar(0.0, 0.0), 0.0)
    rolling.insert_points("laser", [(0.5, -2.5, 0.0)], (0.5, -1.5, 0.0), 1.0)
    for step in range(1, 4):
        rolling.update(Pose.planar(float(step), 0.0), float(step))
        assert rolling.snapshot().cost_at(2.5, 1.5) == LETHAL
    assert rolling.snapshot().cost_at(7.5, 0.5) == UNKNOWN, "new ground comes in unknown"


def test_a_layer_that_raises_when_the_window_moves_begins_anew_with_the_next_update(rolling, monkeypatch):
    rolling.update(Pose.planar(0.0, 0.0), 0.0)
    rolling.insert_points("laser", [(2.5, 1.5, 0.0)], (0.0, 0.0, 0.0), 0.0)
    layer = rolling.layers["obstacle"]
    monkeypatch.setattr(layer, "shift", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        rolling.update(Pose.planar(1.0, 0.0), 1.0)
    assert "layer 'obstacle' raised ZeroDivisionError" in rolling.stale_reason(1.0)
    monkeypatch.undo()
    rolling.update(Pose.planar(1.0, 0.0), 1.5)
    assert layer.geometry == rolling.geometry and rolling.snapshot().cost_at(2.5, 1.5) == LETHAL
    assert "raised" not in rolling.stale_reason(1.5)


def test_what_leaves_the_window_is_forgotten(rolling):
    rolling.insert_points("laser", [(2.5, 1.5, 0.0)], (0.0, 0.0, 0.0), 0.0)
    rolling.update(Pose.planar(0.0, 0.0), 0.0)
    rolling.insert_points("laser", np.zeros((0, 3)), (50.0, 0.0, 0.0), 1.0)
    rolling.update(Pose.planar(50.0, 0.0), 1.0)
    rolling.update(Pose.planar(0.0, 0.0), 2.0)
    assert rolling.snapshot().cost_at(2.5, 1.5) == UNKNOWN


def test_without_a_pose_a_rolling_window_stays(rolling):
    rolling.update(Pose.planar(20.0, 0.0), 0.0)
    rolling.update(None, 1.0)
    assert rolling.snapshot().contains(20.0, 0.0)


@given(st.lists(st.tuples(st.integers(-12, 12), st.integers(-12, 12)), min_size=1, max_size=6))
@settings(max_examples=25, deadline=None)
def test_a_static_map_under_a_rolling_window_is_the_same_as_sampled_anew(moves):
    world = Costmap(np.random.default_rng(3).integers(0, 255, (20, 20)).astype(np.uint8), 1.0, -10.0, -10.0)
    parameters = CostmapParameters.model_validate(
        {"resolution": 1.0, "width": 8.0, "height": 6.0, "rolling_window": True, "track_unknown_space": True}
        | {"layers": [{"name": "walls", "type": "static"}]}
    )
    rolled = build_layered_costmap(parameters, static_map=world)
    x = y = 0
    for dx, dy in moves:
        x, y = x + dx, y + dy
        rolled.update(Pose.planar(x, y), 0.0)
        fresh = build_layered_costmap(parameters, static_map=world)
        fresh.update(Pose.planar(x, y), 0.0)
        assert np.array_equal(rolled.snapshot().cells, fresh.snapshot().cells)


def test_a_pose_in_another_frame_is_refused(build):
    with pytest.raises(ValueError, match="'odom'"):
        build("static").update(Pose.planar(0.0, 0.0, frame_id="odom"), 0.0)


# ---------------------------------------------------------------------------------------------------- clearing
@pytest.mark.parametrize("inside", [True, False])
def test_clearing_an_area_forgets_what_was_seen_but_not_the_floor_plan(build, seeing, inside):
    costmap = build("static", "obstacle", "inflation", obstacle=seeing)
    costmap.update(None, 0.0)
    walls = lethal_cells(costmap)
    costmap.insert_points("laser", [(1.5, 5.5, 0.0)], (0.5, 5.5, 0.0), 0.0)
    costmap.update(None, 0.0)
    assert lethal_cells(costmap) == walls | {(1, 5)}
    assert costmap.clear_area(Pose.planar(5.0 if inside else 99.0, 5.0), 30.0, inside=inside) == ["obstacle"]
    costmap.update(None, 0.1)
    assert walls and lethal_cells(costmap) == walls


def test_clearing_everything_returns_to_the_static_map(build, seeing):
    costmap = build("static", "obstacle", obstacle=seeing)
    costmap.update(None, 0.0)
    walls = lethal_cells(costmap)
    costmap.insert_points("laser", [(1.5, 5.5, 0.0)], (0.5, 5.5, 0.0), 0.0)
    costmap.update(None, 0.0)
    costmap.clear_area(Pose.planar(5.0, 5.0), 30.0, layer_names=["static", "obstacle"], inside=True)
    costmap.update(None, 0.1)
    assert lethal_cells(costmap) == set(), "a static layer that is named loses the area"
    assert costmap.clear() == ["obstacle"], "the floor plan holds nothing that was sensed"
    costmap.update(None, 0.2)
    assert lethal_cells(costmap) == walls


def test_clearing_an_unknown_layer_names_the_known_ones(build):
    with pytest.raises(KeyError, match="no layer 'laser', only"):
        build("static").clear(["laser"])


# ------------------------------------------------------------------------------------------- costs layer by layer
def test_costs_after_each_layer_are_those_of_the_map_with_the_layers_up_to_it():
    seeing = {"footprint_clearing_enabled": False, "sources": {"laser": {"expected_update_rate": 0.0}}}
    watched, parts = with_windows(seeing), [with_windows(seeing) for _ in LAYERS]
    for part, last in zip(parts, range(len(LAYERS)), strict=True):
        for name in LAYERS[last + 1 :]:
            part.set_layer_parameters(name, part.usual_parameters(name).model_copy(update={"enabled": False}))
    assert watched.costs_after_layers(5.0, 5.0) == {}, "they are kept from the first question on"
    for time, place in ((0.1, (6.5, 5.5)), (0.2, (4.5, 7.5))):
        for one in (watched, *parts):
            one.insert_points("laser", [(*place, 0.0)], (10.0, 7.0, 0.0), time)
            one.update(HERE, time)

    for y in np.arange(0.5, 15.0):
        for x in np.arange(0.5, 20.0):
            wanted = [int(part.snapshot().cells[int(y), int(x)]) for part in parts]
            assert watched.costs_after_layers(x, y) == dict(zip(LAYERS, wanted, strict=True))
    assert watched.costs_after_layers(25.0, 5.0) == {}
