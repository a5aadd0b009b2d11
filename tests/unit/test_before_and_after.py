"""benchmarks/before_and_after.py on two small checkouts with a benchmark whose figures are known."""

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "before_and_after.py"
BENCHMARK = """
import json
print("text for people")
print(json.dumps({figures!r}))
"""


def checkout(folder: Path, **figures: float) -> str:
    (folder / "benchmarks").mkdir(parents=True)
    (folder / "benchmarks" / "small.py").write_text(BENCHMARK.format(figures=figures))
    return str(folder)


def test_figures_of_two_checkouts_are_compared_and_those_beyond_the_bar_are_named(tmp_path):
    before = checkout(tmp_path / "a", plan_ms=10.0, load_s=2.0, realtime_factor=4.0, goals=100, only_before_ms=1.0)
    after = checkout(tmp_path / "b", plan_ms=12.0, load_s=2.04, realtime_factor=8.0, goals=300)

    command = [sys.executable, str(SCRIPT), before, after, "--benchmarks", "small", "--repeats", "2", "--json"]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()

    rows = {row["figure"]: (row["ratio"], row["worse"], row["better"]) for row in json.loads(lines[-1])}
    assert rows == {
        "plan_ms": (1.2, True, False),
        "load_s": (1.02, False, False),
        "realtime_factor": (0.5, False, True),
    }
    assert lines[-2] == "3 figures, 1 worse by more than 5%"


def test_a_benchmark_that_fails_ends_the_comparison_with_its_error(tmp_path):
    before, after = checkout(tmp_path / "a", plan_ms=1.0), checkout(tmp_path / "b", plan_ms=1.0)
    (tmp_path / "b" / "benchmarks" / "small.py").write_text("raise ValueError('no such terrain')")

    command = [sys.executable, str(SCRIPT), before, after, "--benchmarks", "small", "--repeats", "1"]
    done = subprocess.run(command, capture_output=True, text=True)

    assert done.returncode == 1 and "no such terrain" in done.stderr
