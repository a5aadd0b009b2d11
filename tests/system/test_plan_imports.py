"""``mbf plan`` on a map file imports the server that reads it, and no other one."""

import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from mbf_abstract.server.factory import MAP_FILES_GROUP, installed_servers

PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
0 0 0
8 0 0
8 8 0
0 8 0
3 0 1 2
3 0 2 3
"""
OFFICE = Path(__file__).resolve().parents[2] / "terrain" / "data" / "office.yaml"
LOOK = """
import sys
from mbf_abstract.server.standing_server import read_config_or_map
from pathlib import Path
read_config_or_map(Path(sys.argv[1]))
print(*sorted({module.split(".")[0] for module in sys.modules if module.startswith("mbf_")}))
"""


def test_a_mesh_needs_no_costmap_server(tmp_path):
    (tmp_path / "square.ply").write_text(PLY)

    command = [sys.executable, "-c", LOOK, str(tmp_path / "square.ply")]
    done = subprocess.run(command, check=True, capture_output=True, text=True)

    assert done.stdout.split() == ["mbf_abstract", "mbf_mesh_nav"]


def test_a_plan_that_nobody_watches_loads_no_progress_bar_and_nothing_that_it_does_not_need():
    plan = ["plan", str(OFFICE), "--start", "3", "9.7", "--goal", "12", "9.7"]
    code = (
        "import sys\n"
        "from mbf_abstract.cli import make_app\n"
        f"make_app()({plan}, standalone_mode=False)\n"
        "print(*sys.modules)"
    )

    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)

    assert "SUCCESS" in done.stdout
    loaded = {*done.stdout.split("\n")[-2].split()}
    assert "numba" in loaded and not loaded & {
        "rich",
        "asyncio",
        "scipy.ndimage",
        "matplotlib",
        "trimesh",
        "mbf_costmap_nav.planning.car_search",
        "mbf_mesh_nav.server",
        "terrain.physics",
    }


@pytest.mark.parametrize("point", sorted(entry_points(group=MAP_FILES_GROUP), key=lambda point: point.name))
def test_the_server_that_is_named_for_a_suffix_reads_it_and_no_other_one_does(point, tmp_path):
    file = tmp_path / f"map.{point.name}"

    readers = [cls for cls in installed_servers() if cls.config_for_map(file) is not None]

    assert [f"{cls.__module__}:{cls.__qualname__}" for cls in readers] == [point.value]
    assert next(installed_servers(file.suffix.upper())) is readers[0]


def test_without_a_suffix_servers_come_by_their_names():
    assert [cls.backend for cls in installed_servers(".nosuch")] == ["costmap", "mesh", "tiles"]
