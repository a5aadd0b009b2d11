"""Drives, a sweep and legs of Table I, each with the SHA-256 of all that its robot did and why it did not succeed.

    python tests/determinism/drives.py indoor switchback table1/B sweep

prints one JSON object, name -> [digest, failure]. Run it under other environments (``conftest.py`` does) and compare.
"""

import hashlib
import json
import sys
import tempfile
from pathlib import Path

from terrain.experiments.table1.conditions import CONDITIONS
from terrain.experiments.table1.environments.world import WAREHOUSE
from terrain.experiments.table1.repetition import run_repetition
from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario

TABLE_1 = "table1/"
SWEEP = "sweep"


def drive(name: str, seed: int | None = None) -> tuple[str, str]:
    """Digest of the shipped scenario ``name``, its outcome included; its verdict unless it has succeeded, else ""."""
    with tempfile.TemporaryDirectory() as folder:
        result = run_scenario(load_scenario(name), RunOptions(Path(folder), seed=seed))
    return f"{result.metrics['digest']}", "" if result.success else f"{result.verdict}"


def table_1_leg(condition: str) -> str:
    """Digest of one leg among other robots, with the track driven to the last bit."""
    run = run_repetition(CONDITIONS[condition], WAREHOUSE, seed=101, legs=1)
    return hashlib.sha256(run.digest.encode() + run.track.tobytes()).hexdigest()


def sweep() -> str:
    """Digest of three seeds of a scenario with noise, as a sweep runs them."""
    return hashlib.sha256("".join(drive("post_forest", seed)[0] for seed in (1, 2, 3)).encode()).hexdigest()


def driven(name: str) -> tuple[str, str]:
    """Digest and failure of a shipped scenario; of ``table1/CONDITION`` and ``sweep`` the digest alone."""
    if name == SWEEP:
        return sweep(), ""
    return (table_1_leg(name.removeprefix(TABLE_1)), "") if name.startswith(TABLE_1) else drive(name)


if __name__ == "__main__":
    sys.stdout.write(json.dumps({name: driven(name) for name in sys.argv[1:]}) + "\n")
