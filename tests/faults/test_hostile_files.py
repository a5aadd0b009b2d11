"""Fault table, row 30: files made to harm: they start nothing, block nothing, take no more memory than their limit."""

import os
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
from PIL import EpsImagePlugin

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.reading import load_config
from mbf_abstract.server.factory import read_config
from mbf_costmap_nav.files.map_description import MapError
from mbf_costmap_nav.files.map_io import load_image, load_map
from mbf_costmap_nav.grid.zones import load_zones
from mbf_mesh_nav.files.lvr2_io import write_lvr2_mesh
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.mesh.repair import MeshError
from terrain.recording.recording import Recording, RecordingError
from terrain.worlds.elevation_files import TerrainFileError, read_elevation

DESCRIPTION = "image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\n"
EPS = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 20 20\n%%EndComments\nshowpage\n%%EOF\n"


@pytest.mark.parametrize("reads", [load_image, load_map])
def test_a_postscript_file_called_png_starts_no_program(tmp_path, monkeypatch, reads):
    victim, ghostscript = tmp_path / "victim", tmp_path / "gs"
    ghostscript.write_text(f"#!/bin/sh\ntouch {victim}\n")
    ghostscript.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(EpsImagePlugin, "gs_binary", None)
    (tmp_path / "map.png").write_bytes(EPS)
    (tmp_path / "map.yaml").write_text(DESCRIPTION)

    with pytest.raises(MapError, match="got a file of another kind"):
        reads(tmp_path / "map.png", 0.05) if reads is load_image else reads(tmp_path / "map.yaml")
    assert not victim.exists()


@pytest.mark.parametrize("name", ["map.png", "map.yaml"])
def test_a_pipe_instead_of_a_map_is_refused_at_once(tmp_path, name):
    (tmp_path / "map.yaml").write_text(DESCRIPTION)
    (tmp_path / name).unlink(missing_ok=True)
    os.mkfifo(tmp_path / name)
    with pytest.raises(MapError, match="got a pipe"):
        load_map(tmp_path / "map.yaml")


@pytest.mark.parametrize(
    ("reads", "name", "error"),
    [
        (load_config, "robot.yaml", ConfigError),
        (load_zones, "zones.yaml", MapError),
        (read_mesh, "mesh.ply", MeshError),
        (read_mesh, "mesh.glb", MeshError),
        (read_mesh, "mesh.h5", MeshError),
        (read_mesh, "mesh.npz", MeshError),
        (read_elevation, "hill.npz", TerrainFileError),
        (read_elevation, "hill.tif", TerrainFileError),
        (Recording.load, "recording.npz", RecordingError),
    ],
)
def test_a_pipe_instead_of_a_file_is_refused_at_once(tmp_path, reads, name, error):
    os.mkfifo(tmp_path / name)
    with pytest.raises(error, match=name):
        reads(tmp_path / name)


def peak_of(reads, *arguments) -> tuple[BaseException, int]:
    """What a reader raises, and how much memory it took for that."""
    tracemalloc.start()
    try:
        with pytest.raises(ValueError if reads is read_mesh else Exception) as caught:
            reads(*arguments)
        return caught.value, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_small_elevation_file_with_gigabytes_in_it_is_refused_in_small_memory(tmp_path):
    np.savez_compressed(tmp_path / "bomb.npz", z=np.zeros((3000, 3000)), dx=1.0, dy=1.0)
    assert (tmp_path / "bomb.npz").stat().st_size < 100_000
    for reads, limit in ((read_elevation, 1_000_000), (read_mesh, 2_000_000)):
        arguments = (limit,) if reads is read_elevation else ("", limit)
        error, peak = peak_of(reads, tmp_path / "bomb.npz", *arguments)
        assert "bomb.npz" in str(error) and "the limit is" in str(error)
        assert peak < 4_000_000


def test_a_small_recording_with_gigabytes_in_it_is_refused_in_small_memory(tmp_path):
    np.savez_compressed(tmp_path / "recording.npz", times=np.zeros(4_000_000))
    error, peak = peak_of(Recording.load, tmp_path / "recording.npz", 10_000_000)
    assert isinstance(error, RecordingError) and "the limit is 10000000" in str(error)
    assert peak < 4_000_000


def hdf5(file: Path, vertices: tuple, faces: tuple) -> Path:
    """An HDF5 mesh whose arrays are promised, compressed and never written."""
    with h5py.File(file, "w") as out:
        for name, shape, kind in (("vertices", vertices, "f4"), ("face_indices", faces, "u4")):
            out.create_dataset(f"mesh/geometry/{name}", shape, kind, chunks=True, compression="gzip")
    return file


@pytest.mark.parametrize(
    ("vertices", "faces", "text"),
    [
        ((300, 3), (2_000_000_000, 3), "2000000000 faces, the limit is 10000000"),
        ((2_000_000_000, 3), (100, 3), "2000000000 vertices, the limit is 30000000"),
    ],
)
def test_a_small_hdf5_file_with_gigabytes_in_it_is_refused_in_small_memory(tmp_path, vertices, faces, text):
    file = hdf5(tmp_path / "bomb.h5", vertices, faces)
    assert file.stat().st_size < 20_000
    error, peak = peak_of(read_mesh, file)
    assert isinstance(error, MeshError) and text in str(error)
    assert peak < 4_000_000


def linked(out: h5py.File, secret: Path) -> None:
    out["mesh/geometry/vertices"] = h5py.ExternalLink(str(secret), "mesh/geometry/vertices")


def stored_elsewhere(out: h5py.File, secret: Path) -> None:
    out.create_dataset("mesh/geometry/vertices", (4, 3), "f4", external=[(str(secret), 0, 48)])


def virtual(out: h5py.File, secret: Path) -> None:
    layout = h5py.VirtualLayout((4, 3), "f4")
    layout[:] = h5py.VirtualSource(str(secret), "mesh/geometry/vertices", (4, 3))
    out.create_virtual_dataset("mesh/geometry/vertices", layout)


@pytest.mark.parametrize("smuggle", [linked, stored_elsewhere, virtual])
def test_an_hdf5_mesh_takes_nothing_from_other_files(tmp_path, smuggle):
    secret = tmp_path / "secret.h5"
    write_lvr2_mesh(secret, np.eye(4, 3), np.array([[0, 1, 2]]))
    with h5py.File(tmp_path / "mesh.h5", "w") as out:
        out["mesh/geometry/face_indices"] = np.array([[0, 1, 2]], np.uint32)
        smuggle(out, secret)
    with pytest.raises(MeshError, match="geometry/vertices lies in another file"):
        read_mesh(tmp_path / "mesh.h5")


BACKEND = "backend: my_maps:Server\nallow_module_types: {}\n"


def test_switching_off_module_types_covers_the_backend(tmp_path, monkeypatch):
    (tmp_path / "my_maps.py").write_text(f"import pathlib\npathlib.Path({str(tmp_path / 'victim')!r}).touch()\n")
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "robot.yaml"
    file.write_text(BACKEND.format("false"))
    with pytest.raises(ConfigError, match=r"robot\.yaml:1: backend: .*switched off \(allow_module_types\)"):
        read_config(file)
    assert not (tmp_path / "victim").exists(), "the module was imported"

    file.write_text(BACKEND.format("true"))
    with pytest.raises(ConfigError, match="has no attribute 'Server'"):
        read_config(file)
    assert (tmp_path / "victim").exists()
