"""Every module runs on the oldest Python that the package promises.

The linters run on a newer one and do not know what the older standard library lacks.
"""

import subprocess
import sys
from importlib.metadata import metadata
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
SHIPPED = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "mbf_ros", "terrain", "examples")


def violations(*places):
    """What vermin finds in files and folders that an older Python lacks than the oldest promised."""
    oldest = metadata("mbf-flex")["Requires-Python"].removeprefix(">=")
    options = ["--no-tips", "--no-config-file", "--eval-annotations", f"--target={oldest}-", "--violations", "--quiet"]
    command = [sys.executable, "-c", "from vermin import main; main()", *options, *map(str, places)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr if done.returncode else ""


def test_nothing_needs_a_newer_python_than_the_oldest_promised():
    assert not violations(*(REPOSITORY / place for place in SHIPPED))


def test_a_name_that_is_newer_is_found(tmp_path):
    module = tmp_path / "newer.py"
    module.write_text("from typing import Self\n", encoding="utf-8")
    assert "typing.Self" in violations(module)
