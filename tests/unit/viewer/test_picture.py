"""Pictures show what was recorded: the right colours at the right places."""

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import Pose
from terrain.physics.robot_models import HUSKY
from terrain.recording.actor_track import ActorTrack
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures import run_picture
from terrain.viewer.pictures.colours import (
    ACTORS,
    BAD,
    DRIVEN,
    FLEET,
    GOAL,
    GOOD,
    OBSTACLE,
    PLANNED,
    WALL,
    WARNING,
    linear_for_viewer,
    slope_colours,
)
from terrain.viewer.pictures.picture import draw_triangles, new_figure, round_length
from terrain.viewer.pictures.run_picture import INCIDENT_COLOUR, joint_picture_png, picture_png
from terrain.viewer.pictures.shading import face_colours, face_normals, shaded_triangles, vertex_colours
from terrain.worlds.multi_level import STOREY
from terrain.worlds.surface import Surface


def pixels_of(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def count(pixels, colour, tolerance=6):
    return int((np.abs(pixels - colour).max(axis=2) <= tolerance).sum())


def test_the_picture_of_an_office_shows_walls_plan_track_and_box(office_recording):
    pixels = pixels_of(picture_png(office_recording))

    for colour in (WALL, PLANNED, DRIVEN, OBSTACLE):
        assert count(pixels, colour) > 100, colour


def test_the_picture_of_an_office_shows_where_people_have_been(office_recording):
    poses = office_recording.poses + np.array([0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    person = ActorTrack("person", np.zeros((0, 3)), np.zeros((0, 3), np.int32), poses)

    with_person = pixels_of(picture_png(replace(office_recording, actors=[person])))

    assert count(with_person, ACTORS["person"]) > 100
    assert count(pixels_of(picture_png(office_recording)), ACTORS["person"]) == 0


def test_triangles_become_one_image_in_which_later_ones_cover_earlier_ones():
    figure, axes = new_figure((0.0, 2.0, 0.0, 1.0))
    left, right = [[0, 0], [1, 0], [0, 1]], [[2, 0], [2, 1], [1, 1]]
    colours = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)])

    draw_triangles(axes, np.array([left, left, right], dtype=np.float64), colours)

    (image,) = axes.images
    pixels = np.asarray(image.get_array())
    shown = [tuple(pixels[int((1.0 - y) * len(pixels)), int(0.5 * x * pixels.shape[1])]) for x, y in PLACES]
    assert not axes.collections
    assert shown == [(0, 0, 255, 255), (0, 255, 0, 255), (0, 0, 0, 0)]
    assert figure.get_axes() == [axes]


PLACES = [(0.2, 0.2), (1.8, 0.8), (1.0, 0.5)]


def test_a_wall_thinner_than_a_pixel_is_seen(office_recording):
    a, b = (2.0, 9.0), (2.0005, 11.0)
    corners = np.array([(*a, 1.0), (b[0], a[1], 1.0), (*b, 1.0), (a[0], b[1], 1.0)])
    thin = Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    open_room = replace(office_recording, walls=None, obstacles=None)

    without, with_wall = (pixels_of(picture_png(run)) for run in (open_room, replace(open_room, walls=thin)))

    assert np.count_nonzero(without.sum(axis=2) - with_wall.sum(axis=2) > 150) > 50


def test_the_picture_of_hills_is_written_to_the_file(hill_recording, tmp_path):
    (tmp_path / "picture.png").write_bytes(picture_png(hill_recording))

    pixels = pixels_of((tmp_path / "picture.png").read_bytes())
    assert min(pixels.shape[:2]) > 600
    assert count(pixels, DRIVEN) > 100


def columns_of(pixels, colour, tolerance=6):
    return np.nonzero((np.abs(pixels - colour).max(axis=2) <= tolerance).any(axis=0))[0]


def test_each_storey_has_a_panel_with_its_part_of_plan_and_track(garage_recording):
    storey = STOREY * np.ones(3)
    plan = [[14.0, 7.0, 0.0], [20.0, 7.0, 0.0], [20.0, 7.0, STOREY], [14.0, 7.0, STOREY]]
    up = replace(garage_recording, paths=[(0.0, np.array(plan))])

    one, two = (pixels_of(picture_png(run)) for run in (replace(up, paths=[(0.0, storey * plan[:2])]), up))

    middle = one.shape[1] // 2
    assert columns_of(one, PLANNED).max() < middle < columns_of(two, PLANNED).max()
    assert columns_of(two, GOAL).min() > middle, "the goal is on the roof"
    boxes = [np.abs(two[:, half] - WALL).max(axis=2) <= 6 for half in (slice(0, middle), slice(middle, None))]
    assert boxes[0].sum() > boxes[1].sum() * 1.02, "pillars and parked cars of the ground floor are in its panel only"


def texts_of(monkeypatch, recording):
    """All that is written in a run's picture."""
    drawn = []
    monkeypatch.setattr(run_picture, "png_bytes", lambda figure: drawn.extend(figure.findobj(Text)) or b"")
    run_picture.picture_png(recording)
    return {text.get_text() for text in drawn}


def test_earlier_plans_are_in_the_legend_where_there_are_any(monkeypatch, office_recording):
    (_, plan) = office_recording.paths[-1]
    once, twice = (replace(office_recording, paths=[(0.0, plan)] * count) for count in (1, 3))

    assert "earlier plans" not in texts_of(monkeypatch, once)
    assert {"plan", "earlier plans"} <= texts_of(monkeypatch, twice)


def test_the_facts_name_a_tilt_only_where_there_was_one(monkeypatch, office_recording, hill_recording):
    assert not any("tilt" in text for text in texts_of(monkeypatch, office_recording))
    assert any("tilt up to" in text for text in texts_of(monkeypatch, hill_recording))


def test_all_robots_of_a_run_are_in_its_picture_with_plan_and_track(two_robots):
    pixels = pixels_of(joint_picture_png(two_robots))

    for colour in FLEET[:2]:
        assert count(pixels, colour) > 800, colour


def test_a_route_in_a_corner_of_the_world_is_shown_large_with_an_inset_of_the_world(large_recording):
    near = replace(large_recording, poses=large_recording.poses[:30], times=large_recording.times[:30], goals=())
    whole = replace(near, ground=Surface(near.ground.vertices, near.ground.faces[:0]), paths=[])

    assert count(pixels_of(picture_png(whole)), DRIVEN) > 2000, "large enough for the robot to be seen"


@pytest.mark.parametrize("what", ["collision_with_person", "slipping", "stuck", "high_centred"])
def test_incidents_are_in_the_picture(hill_recording, what):
    data = {"what": what, "x": 20.0, "y": 12.0, "z": 1.0}
    met = replace(hill_recording, events=(Event(3.0, EventKind.INCIDENT, "simulator", data),))

    red = [int(INCIDENT_COLOUR[k : k + 2], 16) for k in (1, 3, 5)]
    assert count(pixels_of(picture_png(met)), red) > 60
    assert count(pixels_of(picture_png(hill_recording)), red) == 0


@pytest.mark.parametrize(
    ("length", "rounded"), [(1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (4.9, 2.0), (17.0, 10.0), (0.07, 0.05), (600.0, 500.0)]
)
def test_a_scale_bar_has_a_round_length(length, rounded):
    assert round_length(length) == pytest.approx(rounded)


@pytest.mark.parametrize(
    ("failures", "at_goals", "colour"), [((), True, GOOD), (("contacts",), True, WARNING), (("missed",), False, BAD)]
)
def test_the_title_has_the_colour_of_the_verdict(hill_recording, failures, at_goals, colour):
    verdict = Verdict(0, "goal reached", failures, at_goals)

    pixels = pixels_of(picture_png(replace(hill_recording, verdict=verdict)))

    shown = [count(pixels[:60], [int(c[i : i + 2], 16) for i in (1, 3, 5)]) > 100 for c in (GOOD, WARNING, BAD)]
    assert shown == [c == colour for c in (GOOD, WARNING, BAD)]


def test_a_run_that_never_began_has_a_picture_too():
    run = Recorder("nothing", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), []).finish(Verdict(100, "no robot"))

    assert pixels_of(picture_png(run)).size > 0


def test_higher_triangles_are_painted_over_lower_ones():
    bridge = np.array([[0, 0, 3.0], [1, 0, 3.0], [0, 1, 3.0]])
    ground = np.array([[0, 0, 0.0], [2, 0, 0.0], [0, 2, 0.0]])
    surface = Surface(np.concatenate([bridge, ground]), np.array([[0, 1, 2], [3, 4, 5]], np.int32))

    corners, _ = shaded_triangles(surface)

    np.testing.assert_array_equal(corners[-1], bridge[:, :2])


def test_slopes_that_face_the_light_are_brighter():
    to_light = np.array([[0, 0, 0.0], [1, 0, 0.5], [1, 1, 0.0], [0, 1, -0.5]])
    mirrored = to_light * [1, 1, -1] + np.array([2, 0, 0])
    surface = Surface(np.concatenate([to_light, mirrored]), np.array([[0, 1, 2], [4, 5, 6]], np.int32))

    corners, colours = shaded_triangles(surface)

    facing = corners[:, :, 0].min(axis=1) < 1.0
    assert colours[facing].sum() > colours[~facing].sum()


def test_steeper_ground_is_darker_and_redder():
    colours = slope_colours([0.0, 20.0, 45.0, 80.0])

    lightness = colours @ [0.3, 0.6, 0.1]
    assert (np.diff(lightness[:3]) < 0).all()
    np.testing.assert_array_equal(colours[2], colours[3])


def test_vertex_colours_of_a_floor_are_one_grey_and_own_colours_are_kept():
    floor = Surface(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float), np.array([[0, 1, 2]], np.int32))
    painted = face_colours(floor, face_normals(floor), np.full((3, 3), 77, np.uint8))

    assert len(np.unique(vertex_colours(floor), axis=0)) == 1
    assert (painted == 77).all()


@pytest.mark.parametrize(("srgb", "linear"), [(0, 0), (255, 255), (128, 56)])
def test_linear_colours_keep_black_and_white_and_darken_grey(srgb, linear):
    assert linear_for_viewer(np.array([[srgb] * 3], np.uint8))[0, 0] == linear
