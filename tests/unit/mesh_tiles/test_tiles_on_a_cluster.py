"""Tiles that the workers of a Dask scheduler build are those of one machine, to the byte."""

from functools import partial

import numpy as np
import pytest
from distributed import LocalCluster
from test_tile_building import bytes_of
from tiled_terrains import SPACING, settings
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_mesh_nav.mesh.mesh_report import MeshError
from mbf_mesh_nav.tiles.building import cluster_build
from mbf_mesh_nav.tiles.building.build import build_tiles
from mbf_mesh_nav.tiles.building.cluster_build import BuildOrder, build_ordered, entries_from_cluster
from mbf_mesh_nav.tiles.building.sources import HeightSource
from mbf_mesh_nav.tiles.tile import tile_file

pytestmark = pytest.mark.timeout(300)


@pytest.fixture(scope="module")
def scheduler():
    """Address of a scheduler with two workers, which are threads of this process."""
    options = {"processes": False, "protocol": "tcp://", "dashboard_address": None}
    with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", **options) as cluster:
        yield cluster.scheduler_address


def order_of(heights, folder, **changes):
    builder = settings().digest(HeightSource(np.load(heights), SPACING, SPACING))
    return BuildOrder(heights, SPACING, settings(**changes), folder, builder)


def test_the_command_builds_the_same_bytes_on_a_cluster_and_only_what_is_missing(heights, scheduler, tmp_path):
    def build(name, *options):
        plan = [heights, "--spacing", SPACING, "--tile-size", 12, "--out", tmp_path / name, *options]
        done = CliRunner().invoke(make_app(), ["map", "tile", *map(str, plan)])
        assert done.exit_code == 0, done.output

    build("alone")
    build("ours", "--scheduler", scheduler)
    assert bytes_of(tmp_path / "ours") == bytes_of(tmp_path / "alone")
    missing = tile_file(tmp_path / "ours", (1, 0))
    missing.unlink()
    there = {file: file.stat().st_mtime_ns for file in (tmp_path / "ours").glob("tile_*.npz")}
    build("ours", "--scheduler", scheduler)
    assert bytes_of(tmp_path / "ours") == bytes_of(tmp_path / "alone")
    assert len(there) == 3 and all(file.stat().st_mtime_ns == time for file, time in there.items())


def test_a_worker_that_reads_another_file_is_refused(heights, tmp_path):
    (tmp_path / "map").mkdir()
    order = order_of(heights, tmp_path / "map", frame_id="elsewhere")
    with pytest.raises(MeshError, match=r"heights.npy: a worker reads another file there, or has another version"):
        build_ordered(order, (0, 0))
    assert list((tmp_path / "map").iterdir()) == []


def test_a_folder_that_the_machines_do_not_share_is_one_error(heights, tmp_path, monkeypatch):
    def on_another_disk(do, keys, address):
        for key in keys:
            entry = do(key)
            tile_file(tmp_path / "map", key).unlink()
            yield key, entry

    monkeypatch.setattr(cluster_build, "run_on_cluster", on_another_disk)
    source, order = HeightSource(np.load(heights), SPACING, SPACING), order_of(heights, tmp_path / "map")
    with pytest.raises(MeshError, match=r"tile_0_0.npz: a worker has built it, but not here: expected a folder that"):
        entries_of = partial(entries_from_cluster, order, "tcp://nowhere")
        build_tiles(source, order.folder, settings(), entries_of=entries_of)
