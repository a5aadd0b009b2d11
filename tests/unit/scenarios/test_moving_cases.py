"""The worlds of ``benchmarks/moving.py``: a seed and a case give one, whatever other cases there are."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

SOURCE = Path(__file__).resolve().parents[3] / "benchmarks" / "moving.py"
SPEC = spec_from_file_location("moving", SOURCE)
moving = sys.modules["moving"] = module_from_spec(SPEC)
sys.path.insert(0, str(SOURCE.parent))  # it imports its worlds
SPEC.loader.exec_module(moving)
sys.path.remove(str(SOURCE.parent))


def test_another_case_leaves_the_worlds_of_the_others_as_they_are(tmp_path, monkeypatch):
    before = moving.scenario_of("wide", 3, tmp_path).robots
    monkeypatch.setitem(moving.CASES, "another", moving.CASES["bay"])
    assert moving.scenario_of("wide", 3, tmp_path).robots == before
    assert moving.scenario_of("wide", 4, tmp_path).robots != before


def test_the_same_robots_drive_on_every_map_and_the_slope_rises_by_a_tenth(tmp_path):
    made = {name: moving.scenario_of("wide", 3, tmp_path, name) for name in moving.MAPS}
    assert len({scenario.robots for scenario in made.values()}) == 1
    assert [made[name].backend for name in moving.MAPS] == ["costmap", "mesh", "mesh"]
    ground = made["slope"].world.heightfield(np.random.default_rng(0), np.zeros((0, 2)))
    assert ground.height_at(12.0, 3.0) - ground.height_at(8.0, 3.0) == pytest.approx(0.4, abs=0.02)
    assert ground.height_at(10.0, 5.0) - ground.height_at(10.0, 3.0) == pytest.approx(1.0, abs=0.02), "a wall beside it"


@pytest.mark.parametrize("text", ["a:b", "5:2", "1,1", "-3", ""])
def test_wrong_seeds_of_a_benchmark_end_with_one_line_before_anything_is_driven(text, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["moving.py", f"--seeds={text}"])
    with pytest.raises(SystemExit) as ended:
        moving.main()
    said = capsys.readouterr()
    assert ended.value.code == 2 and not said.out
    expected = f"--seeds: expected 0:20 or 1,5,9, each number once and none below 0, got {text!r}"
    assert said.err.splitlines()[-1] == f"moving.py: error: argument {expected}"


def test_every_benchmark_ends_at_ctrl_c_with_one_line():
    scripts = [file for file in SOURCE.parent.glob("*.py") if "__main__" in file.read_text("utf-8")]
    bare = [
        file.name for file in scripts if "    with interruptible():\n        main()\n" not in file.read_text("utf-8")
    ]
    assert len(scripts) >= 40 and not bare
