"""The worlds of ``benchmarks/moving.py``: a seed and a case give one, whatever other cases there are."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

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
