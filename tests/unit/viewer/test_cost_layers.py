"""Costs of the map's layers on the ground of a replay: steps of its nearest vertices, shared where they look alike."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from terrain.recording.recorded_maps import RecordedLayer, RecordedMesh
from terrain.viewer.pictures.layer_scale import end_of_scale
from terrain.viewer.replay.cost_layers import FORBIDDEN, NOT_ON_MAP, STEPS, cost_steps, nearest_vertices
from terrain.viewer.replay.replay_page import replay_html
from terrain.worlds.heightfield import Heightfield


def flat_map(rows=4, columns=5, spacing=1.0):
    ground = Heightfield(np.zeros((rows, columns), np.float32), spacing, spacing).surface()
    return RecordedMesh(0.0, ground.vertices, ground.faces, np.zeros(len(ground.vertices), np.float16))


@settings(max_examples=40)
@given(st.lists(st.floats(0.0, 3.0) | st.just(np.inf), min_size=20, max_size=20))
def test_a_step_is_no_further_from_its_cost_than_half_a_step(costs):
    costs = np.array(costs)
    steps = cost_steps(costs, 2.0, np.arange(20))
    assert (steps[np.isinf(costs)] == FORBIDDEN).all()
    finite = np.isfinite(costs)
    shown = steps[finite] * 2.0 / STEPS
    np.testing.assert_allclose(shown, np.minimum(costs[finite], 2.0), atol=1.0 / STEPS + 1e-9)


def test_ground_beyond_the_map_is_not_on_it():
    surface = flat_map()
    places = np.array([[0.1, 0.1, 0.0], [3.9, 2.8, 0.2], [9.0, 1.0, 0.0], [1.0, 1.0, 3.0]])
    nearest = nearest_vertices(surface, places)
    np.testing.assert_allclose(surface.vertices[nearest[:2]], [[0.0, 0.0, 0.0], [4.0, 3.0, 0.0]])
    assert nearest[2:].tolist() == [-1, -1]
    assert cost_steps(np.zeros(20), 1.0, nearest).tolist() == [0, 0, NOT_ON_MAP, NOT_ON_MAP]
    nothing = RecordedMesh(0.0, np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.float16))
    assert nearest_vertices(nothing, places).tolist() == [-1, -1, -1, -1]


def test_layers_that_look_alike_are_in_the_page_once_and_those_that_say_nothing_are_left_out(
    hill_recording, contents_of
):
    ground = hill_recording.ground
    costs = np.linspace(0.0, 1.0, len(ground.vertices)).astype(np.float16)
    mesh = RecordedMesh(0.0, ground.vertices, ground.faces, costs)
    layers = [
        RecordedLayer("tilt", costs),
        RecordedLayer("limits", costs),
        RecordedLayer("roughness", costs[::-1], "rad"),
        RecordedLayer("empty", np.zeros_like(costs)),
    ]
    run = replace(hill_recording, meshes=[mesh], layers=layers)

    scene, arrays = contents_of(replay_html(run))

    listed = scene["layers"]["list"]
    assert [(name, text) for name, text, _ in listed] == [
        ("tilt", "0 to 0.99"),
        ("limits", "0 to 0.99"),
        ("roughness", "0 to 0.99 rad"),
    ]
    assert listed[0][2] == listed[1][2] != listed[2][2]
    np.testing.assert_array_equal(
        arrays[listed[0][2]].ravel(), cost_steps(costs.astype(float), end_of_scale(layers[0]), np.arange(len(costs)))
    )
