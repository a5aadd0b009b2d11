"""A disk without room: one line that names what was written, nothing half-written, and plans without kept kernels.

A limit on the size of files stands for the disk: the operating system refuses what goes beyond it as it would there.
"""

import os
import subprocess
import sys

import pytest

resource = pytest.importorskip("resource", reason="limits of processes are those of Unix")

MBF = [sys.executable, "-m", "mbf_abstract"]
KERNEL = """
from mbf_abstract.compiling.decorators import kernel

@kernel
def doubled(number):
    return number + number

@kernel
def tripled(number):
    return doubled(number) + number
"""


def limited(command, folder, size, **environment):
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    variables = {
        **os.environ,
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONPATH": os.pathsep.join([str(folder), *sys.path]),
        **environment,
    }
    return subprocess.run(
        [*map(str, command)], cwd=folder, env=variables, preexec_fn=limit, capture_output=True, text=True
    )


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (["config", "costmap_differential", "--map", "floor.yaml", "--out", "robot.yaml"], "robot.yaml"),
        (["new", "planner", "own_planner", "--map", "mesh"], "own_planner"),
        (["tree", "show", "navigation", "--out", "tree.svg", "--format", "svg"], "tree"),
    ],
    ids=["config", "new", "tree"],
)
def test_what_does_not_fit_is_named_and_nothing_of_it_is_left(tmp_path, arguments, name):
    (tmp_path / "floor.yaml").write_text("image: floor.png\n")
    done = limited([*MBF, *arguments], tmp_path, 50)
    assert done.returncode == 2 and done.stderr.startswith("error: ") and name in done.stderr, done.stderr
    assert "File too large" in done.stderr and len(done.stderr.splitlines()) == 1
    assert [file.name for file in tmp_path.iterdir()] == ["floor.yaml"]


def test_a_run_that_does_not_fit_names_its_folder(tmp_path):
    done = limited([*MBF, "run", "crowded_corridor", "--quiet", "--out", "results"], tmp_path, 20_000)
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert done.stderr.splitlines()[-1].startswith("error: results") and "File too large" in done.stderr


def test_kernels_that_cannot_be_kept_run_all_the_same_and_one_warning_says_why(tmp_path):
    (tmp_path / "own" / "kernels").mkdir(parents=True)
    (tmp_path / "own" / "kernels" / "numbers.py").write_text(KERNEL)
    call = "from own.kernels.numbers import tripled; print(tripled(2), tripled(2.0))"
    done = limited([sys.executable, "-c", call], tmp_path, 200, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert done.stdout == "6 6.0\n", done.stderr
    assert done.stderr.count("compiled kernels cannot be kept in ") == 1 and "File too large" in done.stderr
