"""The numbers of the comparison: sums over repetitions, ratios with intervals, and the test of the times.

All tallies come in pairs, condition A and condition B with the same seed, and are resampled as pairs.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from mbf_abstract.geometry import FloatArray
from terrain.experiments.table1.counting import ACTIVITIES, Tally

RESAMPLES = 10_000
BOOTSTRAP_SEED = 20180101
CLEAR = "clear_costmaps"

MEASURES: dict[str, Callable[[Tally], float]] = {
    "planner calls": lambda tally: tally.all_planner_calls,
    "controller calls": lambda tally: tally.controller_calls,
    "recovery calls": lambda tally: tally.all_recoveries,
    "time": lambda tally: tally.time,
}


@dataclass(frozen=True)
class Ratio:
    """Sum of A divided by sum of B with its 95 % interval; all infinite or nan where B has nothing."""

    value: float
    low: float
    high: float


def paired_ratio(a: Sequence[float], b: Sequence[float]) -> Ratio:
    """Return the ratio of sums, with a percentile bootstrap over the pairs (Efron, Tibshirani 1993, section 13.3).

    Raises
    ------
    ValueError
        The two are not equally long, or empty.
    """
    first, second = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    if first.shape != second.shape or first.size == 0:
        raise ValueError(f"pairs are needed, got {first.size} and {second.size} numbers")
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    drawn = rng.integers(first.size, size=(RESAMPLES, first.size))
    ratios = _quotients(first[drawn].sum(axis=1), second[drawn].sum(axis=1))
    low, high = np.percentile(ratios, [2.5, 97.5], method="nearest")  # no interpolation between infinities
    return Ratio(float(_quotients(first.sum(), second.sum())), float(low), float(high))


def _quotients(a: FloatArray, b: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.divide(a, b))


def wilcoxon_p(a: Sequence[float], b: Sequence[float]) -> float:
    """Two-sided p of Wilcoxon's signed rank test; 1 where all pairs are equal."""
    if all(x == y for x, y in zip(a, b, strict=True)):
        return 1.0
    return float(stats.wilcoxon(a, b).pvalue)


def recovery_mix(tallies: Sequence[Tally]) -> Counter[str]:
    """Sum the calls of each behaviour."""
    mix: Counter[str] = Counter()
    for tally in tallies:
        mix.update(tally.recoveries)
    return mix


def entropy(mix: Counter[str]) -> float:
    """Shannon entropy of a mix [bit]; 0 for an empty one."""
    total = sum(mix.values())
    shares = [number / total for number in mix.values() if number]
    return sum(-share * math.log2(share) for share in shares)


def clear_share(mix: Counter[str]) -> float:
    """Share of clearing costmaps in a mix, 0..1; nan for an empty one."""
    total = sum(mix.values())
    return mix[CLEAR] / total if total else math.nan


def time_split(tallies: Sequence[Tally]) -> dict[str, float]:
    """Sum the time of each activity over all legs [s]."""
    return {name: sum(leg.split[name] for tally in tallies for leg in tally.legs) for name in ACTIVITIES}


def compare(a: Sequence[Tally], b: Sequence[Tally]) -> dict[str, Ratio]:
    """Return the ratio A / B of each measure of the table."""
    return {name: paired_ratio([of(t) for t in a], [of(t) for t in b]) for name, of in MEASURES.items()}
