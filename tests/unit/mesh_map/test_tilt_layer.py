"""The footprint on planes, steps and ditches, and against a twin that casts rays for the wheels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_mesh_nav.layers.tilt import HEADINGS, TiltLayer, TiltParameters, heading_index
from mbf_mesh_nav.map.layer import LayerContext
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CORNERS = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
YAWS = 2.0 * np.pi * np.arange(HEADINGS) / HEADINGS


def computed(mesh: MeshMap, **parameters: float) -> TiltLayer:
    settings_ = TiltParameters(**{"center_of_mass_height": 0.0, **parameters})
    layer = TiltLayer(LayerContext("tilt", mesh.topology, mesh.locator, settings_))
    layer.recompute()
    return layer


def ramp(slope: float) -> MeshMap:
    """A plane that rises along +x."""
    return MeshMap.from_heights(np.tile(np.arange(21) * 0.1 * np.tan(slope), (21, 1)), 0.1, 0.1)


def inside(mesh: MeshMap, margin: float = 0.4) -> np.ndarray:
    low, high = mesh.vertices[:, :2].min(axis=0) + margin, mesh.vertices[:, :2].max(axis=0) - margin
    return ((mesh.vertices[:, :2] > low) & (mesh.vertices[:, :2] < high)).all(axis=1)


def test_roll_and_pitch_on_a_ramp_turn_with_the_heading():
    mesh = ramp(0.3)

    layer = computed(mesh)

    middle = inside(mesh)
    np.testing.assert_allclose(
        layer.pitch[middle], np.tile(np.arctan(np.tan(0.3) * np.cos(YAWS)), (middle.sum(), 1)), atol=1e-5
    )
    np.testing.assert_allclose(
        layer.roll[middle], np.tile(np.arctan(-np.tan(0.3) * np.sin(YAWS)), (middle.sum(), 1)), atol=1e-5
    )


def test_ramp_may_be_climbed_but_not_crossed():
    mesh = ramp(0.4)

    layer = computed(mesh, max_roll=0.2, max_pitch_up=0.45, max_pitch_down=0.35)

    vertex = np.flatnonzero(inside(mesh))[0]
    assert layer.allowed[vertex, heading_index(0.0)]
    assert not layer.allowed[vertex, heading_index(np.pi / 2)]
    assert not layer.allowed[vertex, heading_index(np.pi)]
    assert not layer.lethal[vertex]
    best = np.arctan(np.tan(0.4) * np.cos(np.pi / 8)) / 0.45  # the heading beside straight up
    assert layer.costs[vertex] == pytest.approx(best, abs=1e-4)


def test_place_without_an_allowed_heading_is_lethal():
    mesh = ramp(0.6)

    layer = computed(mesh)

    assert layer.lethal.all()
    np.testing.assert_array_equal(layer.costs, 1.0)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000), st.booleans())
def test_angles_equal_those_of_wheels_found_by_rays(seed, rigid):
    rng = np.random.default_rng(seed)
    mesh = MeshMap.from_heights(rng.random((16, 16)) * 0.1, 0.1, 0.1)
    wheelbase, track = rng.uniform(0.2, 0.6, 2)

    layer = computed(mesh, wheelbase=wheelbase, track=track, rigid=rigid)

    for vertex in np.flatnonzero(inside(mesh, 0.45))[::7]:
        for h, yaw in enumerate(YAWS):
            forward, left = np.array([np.cos(yaw), np.sin(yaw), 0]), np.array([-np.sin(yaw), np.cos(yaw), 0])
            wheels = [
                mesh.vertices[vertex] + sx * wheelbase / 2 * forward + sy * track / 2 * left for sx, sy in CORNERS
            ]
            faces, depths = mesh.locator.cast_rays(np.array(wheels) + np.array([0, 0, 5.0]), [0.0, 0.0, -1.0])
            z = mesh.vertices[vertex, 2] + 5.0 - depths
            assert (faces >= 0).all()
            sides, axles = (z[0] - z[2], z[1] - z[3]), (z[0] - z[1], z[2] - z[3])
            stands = (lambda slopes: max(slopes, key=abs)) if rigid else np.mean
            pitch, roll = np.arctan(stands(sides) / wheelbase), np.arctan(stands(axles) / track)
            assert layer.pitch[vertex, h] == pytest.approx(pitch, abs=1e-5)
            assert layer.roll[vertex, h] == pytest.approx(roll, abs=1e-5)


def test_a_rigid_robot_on_a_skew_ledge_is_steeper_than_the_mean_of_its_wheels():
    """What Bullet's Husky does where a bank of 18 to 27 cm crosses its way: 34 degrees, and the mean says 24."""
    heights = np.zeros((21, 21))
    heights[11:] = np.linspace(0.3, 0.1, 21)  # higher on the left of who drives along +y
    mesh = MeshMap.from_heights(heights, 0.1, 0.1)
    swinging, rigid = (computed(mesh, wheelbase=0.512, track=0.571, rigid=value) for value in (False, True))

    vertex = np.argmin(np.hypot(*(mesh.vertices[:, :2] - [1.0, 1.05]).T))
    ahead = heading_index(np.pi / 2)
    assert np.degrees(rigid.pitch[vertex, ahead] - swinging.pitch[vertex, ahead]) > 2.0
    assert (np.abs(rigid.pitch) >= np.abs(swinging.pitch) - 1e-6).all()
    flat = computed(ramp(0.3), rigid=True)
    np.testing.assert_allclose(flat.pitch[inside(ramp(0.3))], computed(ramp(0.3)).pitch[inside(ramp(0.3))], atol=1e-6)


def test_wheel_beyond_the_border_has_no_ground():
    mesh = MeshMap.from_heights(np.zeros((21, 21)), 0.1, 0.1)

    layer = computed(mesh)

    corner = np.argmin(mesh.vertices[:, 0] + mesh.vertices[:, 1])
    assert layer.lethal[corner]
    assert np.isinf(layer.roll[corner]).all()
    assert not layer.lethal[inside(mesh)].any()


def test_bump_between_the_wheels_must_stay_below_the_belly():
    heights = np.zeros((21, 21))
    heights[10, 10] = 0.15
    mesh = MeshMap.from_heights(heights, 0.1, 0.1)
    top = np.argmax(mesh.vertices[:, 2])

    assert computed(mesh, ground_clearance=0.1).lethal[top]
    assert not computed(mesh, ground_clearance=0.2).lethal[top]


def test_low_wall_between_two_floors_carries_no_wheel():
    heights = np.zeros((21, 40))
    heights[:, 20:] = 1.0
    vertices, faces = heightfield_mesh(heights, 0.05, 0.1)
    vertices[vertices[:, 0] > 0.99, 0] -= 0.049

    layer = computed(MeshMap.from_arrays(vertices, faces))

    assert layer.lethal[np.abs(layer.topology.vertices[:, 0] - 0.95) < 0.1].all()


def test_high_centre_of_mass_lowers_the_limits():
    layer = computed(ramp(0.1), center_of_mass_height=0.5, tip_over_margin=0.1, center_of_mass_x=0.05)

    roll, up, down = layer.limits()

    assert roll == pytest.approx(np.arctan2(0.2, 0.5) - 0.1)
    assert up == pytest.approx(min(0.45, np.arctan2(0.3, 0.5) - 0.1))
    assert down == pytest.approx(np.arctan2(0.2, 0.5) - 0.1)


def test_wheels_stay_on_their_storey():
    vertices, faces = heightfield_mesh(np.zeros((21, 21)), 0.1, 0.1)
    ceiling = np.vstack([vertices, vertices * np.array([1.0, 1.0, 0.0]) + np.array([0.0, 0.0, 0.3])])
    mesh = MeshMap.from_arrays(ceiling, np.vstack([faces, faces + len(vertices)]))

    layer = computed(mesh)

    assert (layer.roll[inside(mesh)] == 0.0).all()
    assert not layer.lethal[inside(mesh)].any()


def test_the_share_of_headings_that_is_needed_decides_what_is_lethal_and_what_it_costs():
    mesh = ramp(0.4)
    limits = {"max_roll": 0.2, "max_pitch_up": 0.45, "max_pitch_down": 0.45}

    any_one, half, all_of_them = (computed(mesh, needed_headings=share, **limits) for share in (0.0, 0.375, 1.0))

    middle = inside(mesh)
    share = any_one.allowed[middle].mean(axis=1)
    assert np.allclose(share, 6 / 16)  # up and down the slope, and the headings beside these
    assert not any_one.lethal[middle].any() and not half.lethal[middle].any()
    assert all_of_them.lethal[middle].all()
    assert (half.costs[middle] > any_one.costs[middle]).all()
    worst = np.arctan(np.tan(0.4)) / 0.45  # straight up uses most of the limits
    assert half.costs[middle] == pytest.approx(worst, abs=1e-4)


@pytest.mark.parametrize("share", [0.375, 0.75, 1.0])
def test_ground_that_allows_fewer_headings_than_preferred_costs_1_and_is_not_lethal(share):
    heights = np.random.default_rng(3).uniform(0.0, 0.25, (21, 21))
    mesh = MeshMap.from_heights(heights, 0.2, 0.2)
    needed, preferred = computed(mesh, needed_headings=share), computed(mesh, preferred_headings=share)
    np.testing.assert_array_equal(preferred.costs, needed.costs)
    np.testing.assert_array_equal(preferred.lethal, ~preferred.allowed.any(axis=1))
    few = needed.lethal & ~preferred.lethal
    assert few.any() and (preferred.costs[few] == 1.0).all()


def test_a_centre_of_mass_beyond_the_wheels_is_refused():
    with pytest.raises(ValueError, match="would tip over on flat ground"):
        TiltLayer.Parameters(wheelbase=0.5, center_of_mass_x=-0.25)


@pytest.mark.parametrize("height", [0.2, 0.35, 1.0, 5.0])
def test_no_robot_stands_over_a_post_however_high_it_is(height):
    heights = np.zeros((41, 41))
    heights[20, 20] = height
    layer = computed(MeshMap.from_heights(heights, 0.1, 0.1))
    for sample in (20 * 41 + 21, 21 * 41 + 21):  # beside it and off its corner, with the post below the belly
        assert layer.lethal[layer.topology.input_to_internal[sample]]


@pytest.mark.parametrize(
    ("kind", "key"), [("tilt", "track"), ("tilt", "wheelbase"), ("ridge", "radius"), ("roughness", "radius")]
)
@pytest.mark.parametrize("value", [57.0, 1e308])
def test_a_length_no_robot_has_is_refused_before_the_layer_is_computed(kind, key, value):
    parameters = MeshMapParameters(layers=[{"name": "it", "type": kind}])
    vertices, faces = heightfield_mesh(np.zeros((200, 200)), 0.1, 0.1)
    with pytest.raises(LayerListError, match=rf"layer 'it': {key}: Input should be less than or equal to"):
        build_mesh_map(parameters, {"it": {key: value}}, vertices=vertices, faces=faces)
