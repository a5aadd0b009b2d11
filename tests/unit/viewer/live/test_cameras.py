"""Rays through a picture, values under a pointer, and where the camera of a visitor goes."""

from types import SimpleNamespace

import numpy as np
import pytest

from mbf_abstract.maps.view import GridView, MeshView
from terrain.sensors.rays import StaticRays
from terrain.viewer.live.cameras import CUTAWAY, FIRST_DISTANCE, NEAR, UPRIGHT, Cameras, first_direction, ray_through
from terrain.viewer.live.page import FARTHER
from terrain.viewer.live.readout import Readout
from terrain.worlds.multi_level import parking_garage


def camera(**changes):
    fields = {"position": np.zeros(3), "look_at": np.zeros(3), "wxyz": (1.0, 0.0, 0.0, 0.0), "fov": 0.8, "aspect": 1.5}
    return SimpleNamespace(**{**fields, "near": NEAR, **changes})


def rotation(wxyz):
    w, x, y, z = wxyz
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_a_ray_leads_through_the_places_that_are_seen_there():
    """The reverse of a projection."""
    rng = np.random.default_rng(4)
    for _ in range(50):
        wxyz = rng.normal(size=4)
        wxyz /= np.linalg.norm(wxyz)
        seen_from = camera(
            wxyz=wxyz, position=rng.normal(size=3), fov=rng.uniform(0.3, 2.0), aspect=rng.uniform(0.5, 2.5)
        )
        u, v, depth = *rng.uniform(size=2), rng.uniform(1.0, 50.0)
        half = np.tan(0.5 * seen_from.fov)
        in_camera = depth * np.array([(2 * u - 1) * half * seen_from.aspect, (2 * v - 1) * half, 1.0])
        point = rotation(wxyz) @ in_camera + seen_from.position

        origin, direction = ray_through(seen_from, u, v)

        np.testing.assert_allclose(origin + np.linalg.norm(point - origin) * direction, point, atol=1e-9)


@pytest.mark.parametrize("look", [(10.0, 0.0, 8.0), (3.0, -4.0, 0.1), (0.0, 0.0, 5.0)])
def test_a_following_camera_looks_from_the_same_side_and_never_from_below_the_ground(look):
    direction = first_direction(np.array(look))

    assert np.linalg.norm(direction) == pytest.approx(1.0)
    assert direction[2] > 0.4
    assert np.cross(direction[:2], look[:2]) == pytest.approx(0.0) and direction[:2] @ look[:2] >= 0.0


class Watched:
    """A garage of two storeys, a visitor's camera above it, and the cameras of the page."""

    def __init__(self, recording):
        ground = parking_garage(2).ground
        self.camera = camera(position=np.array([14.0, -10.0, 30.0]), look_at=np.array([14.0, 7.0, 0.0]))
        clients = {3: SimpleNamespace(camera=self.camera)}
        server = SimpleNamespace(get_clients=lambda: clients, initial_camera=camera())
        self.cameras = Cameras(server, recording, ground, StaticRays(*ground), FARTHER)
        self.low, self.high = (np.array([14.0, 7.0, z]) for z in self.cameras._floors)


@pytest.fixture
def watched(garage_recording):
    return Watched(garage_recording)


def test_a_camera_that_follows_keeps_its_distance_and_cuts_away_what_hides_the_robot(watched):
    watched.cameras.choose(3, "follow", watched.low)
    watched.cameras.show(watched.low)
    offset = watched.camera.position - watched.low
    assert np.linalg.norm(offset) == pytest.approx(FIRST_DISTANCE)
    assert watched.camera.near == pytest.approx(np.linalg.norm(offset - (0, 0, 1)) - CUTAWAY), "the roof is cut away"
    further = watched.high + np.array([1.0, 0.0, 0.0])
    watched.cameras.show(further)
    np.testing.assert_allclose(watched.camera.position, further + offset)
    assert watched.camera.near == NEAR, "nothing is above the roof"


def test_a_storey_is_seen_from_above_without_those_over_it(watched):
    watched.cameras.choose(3, "storey", watched.low)
    watched.camera.look_at = np.array(watched.camera.look_at)
    watched.camera.position = np.array(watched.camera.position)
    watched.cameras.show(watched.low)
    cut = watched.camera.position[2] - watched.camera.near
    assert watched.low[2] + 1.0 < cut < watched.high[2]
    watched.cameras.show(watched.high)
    assert watched.camera.near == NEAR
    watched.camera.position = np.array([0.0, -40.0, 20.0])
    watched.cameras.show(watched.low)
    assert watched.camera.near == NEAR, "a view from the side is not cut"


def test_a_camera_that_is_free_or_gone_is_left_alone(watched):
    before = watched.camera.position
    watched.cameras.choose(4, "follow", watched.low)
    watched.cameras.show(watched.low)
    watched.cameras.choose(3, "follow", watched.low)
    watched.cameras.leave(3)
    watched.cameras.show(watched.low)
    assert watched.camera.position is before


@pytest.mark.parametrize("aspect", [0.46, 0.6, 0.9, 1.6])
def test_start_and_goal_are_in_the_first_view_of_an_upright_and_of_a_wide_picture(garage_recording, aspect):
    seen = Watched(garage_recording)
    first, seen.camera.aspect = seen.camera.position, aspect
    seen.cameras.show(seen.low)
    assert (seen.camera.position is first) == (aspect > UPRIGHT), "a wide one has the view of the page"
    seen.cameras.choose(3, "overview", seen.low)
    for pose in (garage_recording.start, *garage_recording.goals):
        across, upward = np.abs(place_in_picture(seen.camera, np.array(pose.position)))
        assert across < 0.9 and upward < 0.9


def place_in_picture(seen_from, point):
    """Where a point is, from -1 to 1 across and upward."""
    ahead = np.array(seen_from.look_at) - seen_from.position
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    offset, half = point - seen_from.position, np.tan(0.5 * seen_from.fov)
    across, upward, depth = (float(offset @ axis) for axis in (right, np.cross(right, ahead), ahead))
    return np.array([across / (depth * half * seen_from.aspect), upward / (depth * half)])


class TwoViews:
    """A server of a map whose layers are given."""

    def __init__(self, **views):
        self.views, self.map_views = views, tuple(views)

    def map_view(self, name):
        return self.views[name]

    def layer_costs(self, name, x, y):
        return {"walls": 0.0, "inflation": 0.25} if name == "whole" and x < 2.0 else {}


def readout(**views):
    made = Readout(TwoViews(**views))
    made.begin_frame()
    return made


def test_the_values_of_cells_are_those_that_the_place_lies_in():
    costs = np.array([[0.0, 0.25, 1.0, np.nan]], dtype=np.float32)
    values = readout(whole=GridView(costs, (0.0, 4.0, 0.0, 1.0)), near=GridView(costs, (2.0, 3.0, 0.0, 1.0)))

    def at(x):
        return [(name, value) for name, value, _ in values.rows(np.array([x, 0.5, 0.1]))]

    layers = [("\u2003walls", "0.00"), ("\u2003inflation", "0.25")]
    assert at(1.5) == [("place", "1.50, 0.50, 0.10 m"), ("whole", "0.25"), *layers, ("near", "outside")]
    assert at(2.6)[1:] == [("whole", "forbidden"), ("near", "forbidden")]
    assert at(3.5)[1:] == [("whole", "unknown"), ("near", "outside")]


def test_the_values_of_a_mesh_are_those_of_the_nearest_vertex_on_its_storey():
    rng = np.random.default_rng(2)
    vertices = np.vstack([np.c_[rng.uniform(0, 10, (200, 2)), np.full(200, z)] for z in (0.0, 3.0)])
    costs = np.arange(400, dtype=np.float32)
    costs[17] = np.inf
    layers = {"slope": MeshView(vertices, np.zeros((0, 3), np.int32), costs)}
    values = readout(**layers)
    for place in rng.uniform(0, (10, 10, 3), (100, 3)):
        nearest = int(np.argmin(np.linalg.norm(vertices - place, axis=1)))
        wanted = "forbidden" if nearest == 17 else f"{costs[nearest]:.3g}"
        assert values.rows(place)[1][:2] == ("slope", wanted)
    assert values.rows(vertices[17])[1][1] == "forbidden"
