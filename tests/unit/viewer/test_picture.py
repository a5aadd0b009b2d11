"""Pictures show what was recorded: the right colours at the right places."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from mbf_abstract.geometry import Pose
from terrain.physics.robot_models import HUSKY
from terrain.recording.actor_track import ActorTrack
from terrain.recording.recorder import Recorder
from terrain.recording.recording import RobotShape
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures.colours import (
    ACTORS,
    BAD,
    DRIVEN,
    GOOD,
    OBSTACLE,
    PLANNED,
    WALL,
    WARNING,
    linear_for_viewer,
    slope_colours,
)
from terrain.viewer.pictures.picture import picture_png
from terrain.viewer.pictures.shading import face_colours, face_normals, shaded_triangles, vertex_colours
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


def test_the_picture_of_hills_is_written_to_the_file(hill_recording, tmp_path):
    (tmp_path / "picture.png").write_bytes(picture_png(hill_recording))

    pixels = pixels_of((tmp_path / "picture.png").read_bytes())
    assert min(pixels.shape[:2]) > 600
    assert count(pixels, DRIVEN) > 100


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
