"""Speed of two versions of this code, run by turns: which figures of the benchmarks have become better or worse.

    python benchmarks/before_and_after.py BEFORE AFTER [--benchmarks grid_speed,mesh_speed] [--repeats 5]
                                          [--options "--quick"] [--json]

BEFORE and AFTER are each ``CHECKOUT`` or ``CHECKOUT=PYTHON``, with the interpreter of the environment in which that
checkout is installed; without one it is the interpreter that runs this. Each benchmark runs once to compile and then by
turns in both, so that a machine that gets slower is slower for both. Figures with the same name in both are compared
if they are times or rates; a ratio is that of the medians, its range that of the pairs. A figure counts as worse where
the ratio is beyond the bar AND every pair agrees on the direction: single pairs differ by more than the bar on a busy
machine.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from mbf_abstract.time.program_end import interruptible

BENCHMARKS = "core_latency,simulation_speed,mesh_layers,mesh_start,controllers,grid_speed,mesh_speed"
BAR = 1.05
LOWER_IS_BETTER = ("_ms", "_us", "_s", "_ms_p")  # without the digits at the end
HIGHER_IS_BETTER = ("_factor", "_per_second", "_over_bullet_rays")
NOT_SPEEDS = ("limits", "scipy_s")  # bars, and what a peer alone takes

Figures = dict[str, float]


@dataclass(frozen=True)
class Version:
    """One checkout and the interpreter in whose environment it is installed."""

    checkout: Path
    python: str

    @classmethod
    def parse(cls, text: str) -> Version:
        """Read ``CHECKOUT`` or ``CHECKOUT=PYTHON``."""
        checkout, _, python = text.partition("=")
        return cls(Path(checkout).resolve(), python or sys.executable)

    def run(self, benchmark: str, options: list[str]) -> Figures:
        """Figures of one run, with the path to each in the JSON of its last line."""
        command = [self.python, f"benchmarks/{benchmark}.py", *options, "--json"]
        done = subprocess.run(command, cwd=self.checkout, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{shlex.join(command)} in {self.checkout} ended with {done.returncode}:\n{done.stderr}")
        return dict(leaves(json.loads(done.stdout.splitlines()[-1])))


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Each number of a JSON document that is a speed, with its path."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key not in NOT_SPEEDS:
                yield from leaves(inner, f"{path}.{key}" if path else key)
    elif isinstance(value, int | float) and not isinstance(value, bool) and direction(path) and value > 0:
        yield path, float(value)


def direction(path: str) -> int:
    """1 where less is better, -1 where more is, 0 where the figure is no speed."""
    words = [word for word in path.split(".") if not word[0].isdigit()]
    name = words[-1].rstrip("0123456789").rstrip("_")
    if name.endswith(HIGHER_IS_BETTER):
        return -1
    timed = name.endswith(LOWER_IS_BETTER) or "_over_" in name or "sizes" in words
    return 1 if timed else 0


def compare(before: Version, after: Version, benchmark: str, options: list[str], repeats: int) -> list[dict[str, Any]]:
    """A row for each figure that both versions have."""
    for version in (before, after):
        version.run(benchmark, options)  # compiles
    pairs = [(before.run(benchmark, options), after.run(benchmark, options)) for _ in range(repeats)]
    return [
        row_of(benchmark, name, pairs) for name in pairs[0][0] if all(name in run for pair in pairs for run in pair)
    ]


def row_of(benchmark: str, name: str, pairs: list[tuple[Figures, Figures]]) -> dict[str, Any]:
    """Both medians, their ratio (above 1: worse) and what the pairs say."""
    sign = direction(name)
    first, second = median(pair[0][name] for pair in pairs), median(pair[1][name] for pair in pairs)
    ratios = sorted((pair[1][name] / pair[0][name]) ** sign for pair in pairs)
    ratio = (second / first) ** sign
    row = {"benchmark": benchmark, "figure": name, "before": first, "after": second, "ratio": round(ratio, 3)}
    row |= {"lowest": round(ratios[0], 3), "highest": round(ratios[-1], 3)}
    return row | {"worse": ratio > BAR and ratios[0] > 1.0, "better": ratio < 1.0 / BAR and ratios[-1] < 1.0}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Version.parse)
    parser.add_argument("after", type=Version.parse)
    parser.add_argument("--benchmarks", default=BENCHMARKS)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--options", default="--quick", help="passed on to each benchmark, in one argument")
    parser.add_argument("--json", action="store_true", help="print all rows as last line")
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for benchmark in arguments.benchmarks.split(","):
        some = compare(arguments.before, arguments.after, benchmark, shlex.split(arguments.options), arguments.repeats)
        for row in some:
            verdict = "worse" if row["worse"] else "better" if row["better"] else ""
            spread = f"[{row['lowest']:.2f}, {row['highest']:.2f}]"
            print(
                f"{benchmark:18} {row['figure']:46} {row['before']:11.5g} {row['after']:11.5g} {row['ratio']:6.2f} "
                f"{spread} {verdict}",
                flush=True,
            )
        rows += some
    print(f"{len(rows)} figures, {sum(row['worse'] for row in rows)} worse by more than {BAR - 1:.0%}")
    if arguments.json:
        print(json.dumps(rows))


if __name__ == "__main__":
    with interruptible():
        main()
