"""Our own robots in each other's way on a mesh: worlds of ``benchmarks/moving.py`` that went wrong."""

import sys
from pathlib import Path

import pytest

import mbf_abstract

pytestmark = pytest.mark.timeout(300)
BENCHMARKS = Path(mbf_abstract.__file__).parents[1] / "benchmarks"


@pytest.fixture
def moving(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(BENCHMARKS), *sys.path])
    import moving

    return moving


@pytest.mark.parametrize(
    ("case", "executive"),
    [
        ("dead_end", "navigation"),  # one found no manoeuvre that it was let drive, so neither gave way
        ("bay", "move_base"),  # one cut a corner as it came out of the bay
    ],
)
def test_all_arrive_and_touch_nothing(moving, case, executive):
    row = moving.run(case, 100, executive, on="mesh")
    assert row["verdict"].startswith("SUCCESS"), row["verdict"]
    assert row["arrived"] == row["robots"] and row["contacts"] == row["contacts_while_moving"] == 0
