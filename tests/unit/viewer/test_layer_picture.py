"""The costs of each layer of a mesh map are recorded once, drawn side by side, and stand in the report."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.view import MeshView
from terrain.physics.robot_models import HUSKY
from terrain.recording.metrics import measure
from terrain.recording.recorded_maps import RecordedLayer, layer_arrays, layers_from
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import MAP_PERIOD, Recorder
from terrain.recording.recording import Recording
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures.colours import WALL, cost_colours_up_to
from terrain.viewer.pictures.layer_picture import NOWHERE, layer_picture_png, painted
from terrain.viewer.pictures.layer_scale import range_text
from terrain.viewer.reports.report import report_html
from terrain.worlds.heightfield import Heightfield

COSTS = {"safe": [0.0, 0.5, 1.0], "slope": [0.1, 0.2, np.inf], "empty": [0.0, 0.0, 0.0]}
CORNERS = np.array([[0.0, 0.0, 0.1], [2.0, 0.0, 0.2], [0.0, 1.0, 0.3]])
FACES = np.array([[0, 1, 2]], np.int32)


UNITS = {"slope": "rad"}


def look(name=""):
    return MeshView(CORNERS, FACES, np.array(COSTS[name or "safe"], np.float32), UNITS.get(name, ""))


def a_recorder(**changes):
    return Recorder("mapped", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), [Pose.planar(2, 0)], **changes)


@pytest.fixture
def recording():
    recorder = a_recorder()
    recorder.map(0.0, look, tuple(COSTS))
    return recorder.finish(Verdict(0, "good"))


def test_layers_are_recorded_with_the_first_look_and_come_back_from_the_file(tmp_path):
    recorder = a_recorder()
    for turn in range(2):
        recorder.map(MAP_PERIOD * turn, look, tuple(COSTS))
    recorder.finish(Verdict(0, "good")).save(tmp_path / "recording.npz")
    layers = Recording.load(tmp_path / "recording.npz").layers
    assert [layer.name for layer in layers] == list(COSTS)
    for layer in layers:
        np.testing.assert_allclose(layer.costs, COSTS[layer.name], atol=1e-3)
        assert layer.unit == UNITS.get(layer.name, "")


def test_a_recording_of_an_earlier_version_has_layers_without_units(recording):
    arrays = layer_arrays(recording.layers)
    del arrays["layer_units"]
    assert [layer.unit for layer in layers_from(arrays)] == ["", "", ""]


def test_what_colours_stand_for_is_said_with_the_unit(recording):
    assert [range_text(layer) for layer in recording.layers] == ["0 to 0.99", "0 to 0.2 rad", "0 to 1"]


def test_layers_are_recorded_as_far_as_the_budget_of_a_run_goes():
    recorder = a_recorder(map_budget=6)
    recorder.map(0.0, look, tuple(COSTS))
    assert [layer.name for layer in recorder.layers] == ["safe"]


def size_of(png):
    return Image.open(io.BytesIO(png)).size


def test_every_layer_that_says_something_has_a_panel(recording):
    one, two, all_of_them = (
        size_of(layer_picture_png(recording, names)) for names in (["slope"], ["slope", "safe"], ())
    )
    assert two[0] > 1.8 * one[0]
    assert all_of_them == two  # the third one is the same everywhere


def test_faces_are_painted_by_their_costs_where_they_are():
    ground = Heightfield(np.zeros((2, 3), np.float32), 1.0, 1.0).surface()
    costs = np.where(ground.vertices[:, 0] > 1.5, np.inf, 0.5)
    pixels = painted(ground.vertices, ground.faces, costs, 1.0, (0.0, 2.0, 0.0, 1.2))
    height, width, _ = pixels.shape
    assert pixels[-10, 10].tolist() == cost_colours_up_to(1.0, [0.5])[0].tolist()
    assert pixels[-10, width - 10].tolist() == list(WALL)
    assert pixels[5, 10].tolist() == list(NOWHERE)  # north is at the top, and there is no ground
    assert width > height


def test_the_upper_one_of_two_surfaces_is_seen():
    corners = np.concatenate([CORNERS, np.add(CORNERS, (0.0, 0.0, 3.0))])
    pixels = painted(corners, np.array([[3, 4, 5], [0, 1, 2]], np.int32), np.repeat([0.0, 1.0], 3), 1.0, (0, 2, 0, 1))
    assert pixels[-10, 10].tolist() == cost_colours_up_to(1.0, [1.0])[0].tolist()


def test_the_report_has_the_layers_of_a_run_that_recorded_them(recording):
    pages = [report_html(one, measure(one).to_json()) for one in (recording, replace(recording, layers=[]))]
    assert ["Costs by layer" in page for page in pages] == [True, False]


def test_a_layer_that_forbids_everything_is_drawn_too(recording):
    forbidden = RecordedLayer("closed", np.full(3, np.inf, np.float16))
    assert size_of(layer_picture_png(replace(recording, layers=[forbidden]), ["closed"]))[0] > 100
