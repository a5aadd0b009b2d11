"""The moving picture shows the world where it is, and a robot that drives through it."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from mbf_abstract.geometry import Pose
from terrain.physics.robot_models import HUSKY
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures.animation import FRAMES, SIZE, write_animation
from terrain.viewer.pictures.colours import BODY, DRIVEN, OBSTACLE, PLANNED, SCAN
from terrain.viewer.pictures.film import ENDING, FRAME_RATE, shots, write_film
from terrain.viewer.pictures.moving_picture import MovingPicture, overview_camera
from terrain.viewer.pictures.picture import ViewerMissing
from terrain.viewer.pictures.raster import paint_triangles


def frames_of(file):
    with Image.open(file) as movie:
        for number in range(movie.n_frames):
            movie.seek(number)
            yield np.asarray(movie.convert("RGB")).astype(int)


def middle(pixels, colour, tolerance=30):
    """Mean pixel (x, y) of a colour, and how many there are."""
    y, x = np.nonzero(np.abs(pixels - colour).max(axis=2) <= tolerance)
    return np.array([x.mean(), y.mean()]) if len(x) else None, len(x)


def test_the_world_is_drawn_where_the_camera_projects_it(office_recording):
    camera = overview_camera(office_recording, SIZE)
    pixels = np.asarray(MovingPicture(office_recording, SIZE).frame(0, follow=False)).astype(int)
    top = office_recording.obstacles.vertices[office_recording.obstacles.vertices[:, 2] > 0.9].mean(axis=0)
    x, y = camera.project(top[None])[0, :2].astype(int)

    assert np.abs(pixels[y, x] - OBSTACLE).max() < 30, "the top of the box, in the light"


def test_the_robot_moves_and_leaves_its_track(hill_recording, tmp_path):
    write_animation(tmp_path / "run.gif", hill_recording)

    frames = list(frames_of(tmp_path / "run.gif"))
    camera = overview_camera(hill_recording, SIZE)
    begin, end = (camera.project(hill_recording.poses[[index], :3])[0, :2] for index in (0, -1))
    assert len(frames) == FRAMES and frames[0].shape == (SIZE[1], SIZE[0], 3)
    assert np.linalg.norm(middle(frames[0], BODY)[0] - begin) < 25.0
    assert np.linalg.norm(middle(frames[-1], BODY)[0] - end) < 25.0
    assert middle(frames[-1], DRIVEN)[1] > 4 * max(middle(frames[2], DRIVEN)[1], 50)
    assert middle(frames[3], PLANNED)[1] > 200
    assert (tmp_path / "run.gif").stat().st_size < 1.5e6


def test_a_run_that_never_began_is_a_still_picture(tmp_path):
    empty = Recorder("nothing", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), []).finish(Verdict(100, "no robot"))
    write_animation(tmp_path / "nothing.gif", empty)

    assert len({frame.tobytes() for frame in frames_of(tmp_path / "nothing.gif")}) == 1


@pytest.mark.parametrize(("spacing", "shown"), [(1.0, False), (6.0, True)])
def test_a_scan_is_shown_until_a_newer_one_is_due(hill_recording, spacing, shown):
    scan = hill_recording.poses[40, :3] + np.random.default_rng(1).uniform([-5, -5, 1.5], [5, 5, 2.5], (400, 3))
    run = replace(hill_recording, scans=[(now, scan) for now in (4.0 - spacing, 4.0)])

    red = [middle(np.asarray(MovingPicture(run, SIZE).frame(at, follow=False)).astype(int), SCAN)[1] for at in (45, 90)]

    assert red[0] > 50
    assert (red[1] > 50) == shown


def first_second(recording):
    """A second from the middle of a run."""
    part = slice(100, 111)
    kept = {name: getattr(recording, name)[part] for name in ("times", "poses", "twists", "commands")}
    return replace(recording, **kept)


def yellow(pixels):
    return int(((pixels[..., 0] > 1.1 * pixels[..., 1]) & (pixels[..., 1] > 2.2 * pixels[..., 2])).sum())


def test_a_film_is_the_same_bytes_every_time_and_ends_with_an_overview(hill_recording, tmp_path):
    av = pytest.importorskip("av")
    short, size = first_second(hill_recording), (160, 90)
    for name in ("one.mp4", "two.mp4"):
        write_film(tmp_path / name, short, size)

    assert (tmp_path / "one.mp4").read_bytes() == (tmp_path / "two.mp4").read_bytes()
    with av.open(str(tmp_path / "one.mp4")) as film:
        frames = [frame.to_ndarray(format="rgb24").astype(int) for frame in film.decode(video=0)]
        assert film.streams.video[0].average_rate == FRAME_RATE
    assert len(frames) == len(list(shots(short))) == FRAME_RATE * (1 + ENDING)
    assert frames[0].shape == (90, 160, 3)
    still = np.asarray(MovingPicture(short, size).frame(10, follow=False)).astype(int)
    assert np.abs(frames[-1] - still).mean() < 8.0


def test_shots_alternate_overview_and_follow_through_all_of_the_run(hill_recording):
    wanted = list(shots(hill_recording))

    assert len(wanted) == FRAME_RATE * (20 + ENDING)
    indices = [index for index, _ in wanted]
    assert indices == sorted(indices) and indices[0] == 0 and indices[-1] == len(hill_recording.times) - 1
    changes = [number / FRAME_RATE for number in range(1, len(wanted)) if wanted[number][1] != wanted[number - 1][1]]
    assert changes == [4.0, 10.0, 14.0, 20.0]


def test_the_robot_is_seen_under_a_roof_from_both_cameras(garage_recording):
    picture = MovingPicture(garage_recording, (320, 180))

    seen = [yellow(np.asarray(picture.frame(40, follow)).astype(int)) for follow in (False, True)]
    assert min(seen) > 80


def test_a_film_without_the_package_names_the_extra(hill_recording, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)

    with pytest.raises(ViewerMissing, match=r"pip install 'mbf-flex\[video\]'"):
        write_film(tmp_path / "film.mp4", hill_recording)
    assert list(tmp_path.iterdir()) == []


def naive_picture(corners, colours, size):
    """Each pixel on its own: the nearest triangle whose inside has the pixel's middle."""
    pixels, depths = np.zeros((*size, 3), np.uint8), np.zeros(size)
    for y, x in np.ndindex(size):
        for triangle, colour in zip(corners, colours, strict=True):
            system = np.vstack([triangle[:, :2].T, np.ones(3)])
            if abs(np.linalg.det(system)) < 1e-6:
                continue
            weights = np.linalg.solve(system, [x + 0.5, y + 0.5, 1.0])
            depth = weights @ triangle[:, 2]
            if weights.min() >= 0.0 and depth > depths[y, x]:
                pixels[y, x], depths[y, x] = colour, depth
    return pixels, depths


@settings(max_examples=15)
@given(st.integers(0, 2**32))
def test_triangles_are_painted_as_pixel_by_pixel(seed):
    rng, size = np.random.default_rng(seed), (7, 9)
    corners = rng.uniform([-4.0, -4.0, 0.1], [13.0, 11.0, 1.0], (6, 3, 3))
    colours = rng.integers(1, 255, (6, 3)).astype(np.uint8)
    pixels, depths = np.zeros((*size, 3), np.uint8), np.zeros(size, np.float32)

    paint_triangles(corners, colours, pixels, depths)

    wanted, wanted_depths = naive_picture(corners, colours, size)
    np.testing.assert_allclose(depths, wanted_depths, atol=1e-6)
    np.testing.assert_array_equal(pixels, wanted)
