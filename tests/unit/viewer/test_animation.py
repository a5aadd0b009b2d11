"""The moving picture shows the world where it is, and a robot that drives through it."""

import numpy as np
from PIL import Image

from mbf_abstract.geometry import Pose
from terrain.physics.robot_models import HUSKY
from terrain.recording.recorder import Recorder
from terrain.recording.recording import RobotShape
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures.animation import FRAMES, SIZE, Camera, draw_world, write_animation
from terrain.viewer.pictures.colours import BODY, DRIVEN, OBSTACLE, PLANNED


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
    camera = Camera(office_recording, SIZE)
    pixels = np.asarray(draw_world(office_recording)).astype(int)
    top = office_recording.obstacles.vertices[office_recording.obstacles.vertices[:, 2] > 0.9].mean(axis=0)
    x, y = camera.project(top[None])[0].astype(int)

    assert np.abs(pixels[y, x] - OBSTACLE).max() < 30, "the top of the box, in the light"


def test_the_robot_moves_and_leaves_its_track(hill_recording, tmp_path):
    write_animation(tmp_path / "run.gif", hill_recording)

    frames = list(frames_of(tmp_path / "run.gif"))
    camera = Camera(hill_recording, SIZE)
    begin, end = (camera.project(hill_recording.poses[[index], :3])[0] for index in (0, -1))
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
