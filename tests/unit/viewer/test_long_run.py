"""What a run of five minutes leaves is small: 259,200 triangles, replanned every second, with a lidar."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Twist
from terrain.physics.robot_models import HUSKY
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.verdict import Verdict
from terrain.viewer.logs.mcap_log import write_mcap
from terrain.viewer.replay.replay_page import replay_html
from terrain.worlds.generate import fractal_terrain

MOST = 15e6  # bytes
DURATION, RATE = 300.0, 10.0


@pytest.fixture(scope="module")
def long_run():
    rng = np.random.default_rng(1)
    hills = fractal_terrain(180.0, 180.0, 0.5, rng, roughness=0.03)
    angles = np.linspace(0.0, 5.0, round(DURATION * RATE))
    poses = [hills.pose_at(90 + 60 * math.cos(a), 90 + 60 * math.sin(a), a + math.pi / 2) for a in angles]
    way = np.array([pose.position for pose in poses])
    ground = hills.surface()
    recorder = Recorder("long", "mesh", RobotShape.of(HUSKY), poses[0], [poses[-1]], ground=ground)
    for index, pose in enumerate(poses):
        recorder.sample(index / RATE, pose, Twist.planar(1.0), Twist.planar(1.0))
        if index % RATE == 0:
            recorder.path(index / RATE, way[index::4])
            recorder.scan(index / RATE, way[index] + 4.0 * rng.normal(size=(720, 3)), way[index])
    return recorder.finish(Verdict(0, "goal reached"))


def test_the_run_is_as_long_and_the_ground_as_large_as_promised(long_run):
    assert long_run.duration > 299.0 and len(long_run.paths) == 300
    assert len(long_run.ground.faces) > 250_000


def test_its_files_are_below_the_limit(long_run, tmp_path):
    write_mcap(tmp_path / "run.mcap", long_run)

    assert 1e6 < (tmp_path / "run.mcap").stat().st_size < MOST
    assert 5e5 < len(replay_html(long_run).encode()) < MOST / 5
