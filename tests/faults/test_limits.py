"""Fault table, row 29: huge inputs: configurations, map images, meshes and paths."""

import tracemalloc

import numpy as np
import pytest
import trimesh

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.reading import load_config
from mbf_abstract.geometry import Path
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_costmap_nav.files.map_description import MapError
from mbf_costmap_nav.files.map_io import load_image, load_map
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.mesh.repair import MeshError
from promises import assert_ended_once, assert_next_goals_work

SMALL = 4_000_000  # bytes; far below every input that is claimed here
POSES = 100_000


@pytest.fixture
def peak_memory():
    """Bytes allocated at most since the test began, as a function."""
    tracemalloc.start()
    yield lambda: tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()


def test_a_configuration_of_10_megabytes_is_refused_before_it_is_read_whole(tmp_path, peak_memory):
    file = tmp_path / "huge.yaml"
    with file.open("w") as text:
        text.writelines("- {name: planner, type: cvp}\n" for _ in range(350_000))
    assert file.stat().st_size > 10_000_000
    with pytest.raises(ConfigError, match="expected at most 1000000 bytes, got a larger file"):
        load_config(file)
    assert peak_memory() < SMALL


@pytest.mark.parametrize(
    ("size", "text"),
    [
        (9_000, "9000 x 9000 pixels are more than the limit of 64000000 cells"),
        (14_000, r"has too many pixels: .*196000000 pixels"),
        (2_000_000_000, "has too many pixels"),
    ],
)
def test_an_image_that_claims_an_absurd_size_is_refused_before_its_pixels_get_memory(tmp_path, size, text, peak_memory):
    (tmp_path / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % (size, size) + bytes(100))
    (tmp_path / "map.yaml").write_text("{image: map.pgm, resolution: 0.05, origin: [0, 0, 0]}\n")
    with pytest.raises(MapError, match=text) as from_yaml:
        load_map(tmp_path / "map.yaml")
    with pytest.raises(MapError, match=text):
        load_image(tmp_path / "map.pgm", 0.05)
    assert "map.pgm" in str(from_yaml.value)
    assert peak_memory() < SMALL


def test_a_mesh_with_more_faces_than_allowed_is_refused(tmp_path):
    file = tmp_path / "box.ply"
    trimesh.creation.box().export(file)
    with pytest.raises(MeshError, match=r"box\.ply: 12 faces, the limit is 11"):
        read_mesh(file, max_faces=11)
    assert len(read_mesh(file, max_faces=12)[1]) == 12


def test_a_mesh_that_claims_a_billion_faces_is_refused_before_they_get_memory(tmp_path, peak_memory):
    file = tmp_path / "liar.ply"
    trimesh.creation.box().export(file)
    file.write_bytes(file.read_bytes().replace(b"element face 12\n", b"element face 1000000000\n"))
    with pytest.raises(MeshError, match=r"liar\.ply: cannot be read as ply"):
        read_mesh(file)
    assert peak_memory() < SMALL


def test_a_path_of_100000_poses_is_followed_in_bounded_memory():
    path = Path.from_points(np.linspace((0.0, 0.0, 0.0), (POSES * 0.05, 0.0, 0.0), POSES))
    with ScriptedSession() as session:
        session.controller.play(drive(0.3))
        tracemalloc.start()
        handle = session.navigator.send(ExePathGoal(path))
        session.clock.sleep(1.0)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        handle.cancel()
        handle.wait()
        assert len(session.controller.paths[0]) == POSES
        assert len(session.controller.requests) >= 19  # from the first cycle on, at 20 Hz
        assert session.robot.moved_after(0.0)
        assert_ended_once(session, handle)
        assert peak < 3 * (path.positions.nbytes + path.orientations.nbytes)
        assert_next_goals_work(session)
