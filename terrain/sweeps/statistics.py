"""What the runs of a sweep say: medians with their spread and confidence, and whether two variants differ.

Medians come with the interquartile range and a 95 % interval of the percentile bootstrap (Efron 1979): runs are drawn
again with replacement, the interval holds the middle 95 % of the medians. Success rates have Wilson's interval (1927),
which stays between 0 and 1 and is right for few runs.

Two variants are compared on the seeds that both have run, pair by pair, because a seed gives both the same world,
noise and traffic. Numbers: Wilcoxon's signed-rank test (1945), which needs no normal distribution and is not led by one
slow run; its p comes from all changes of the signs, or from ``DRAWS`` seeded ones, which is right for ties and zeros,
too. Success: McNemar's exact test (1947), a binomial test of the seeds in which only one of the two succeeded. The
p of all tests, of every pair of variants in every metric, are corrected together by Holm's method (1979).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray

Row = Mapping[str, Any]

DRAWS = 9999
BLOCK = 1_000_000  # numbers that are drawn at a time
CONFIDENCE = 0.95
WILSON_Z = 1.959963984540054  # 97.5 % quantile of the normal distribution


@dataclass(frozen=True)
class Metric:
    """A column of the results: its title, and whether runs that are no success count, too."""

    name: str
    title: str
    of_all_runs: bool = False


METRICS = (
    Metric("spl", "SPL", of_all_runs=True),
    Metric("time_s", "time [s]"),
    Metric("path_length_m", "length [m]"),
    Metric("path_over_geodesic", "length / shortest"),
    Metric("clearance_min_m", "clearance [m]", of_all_runs=True),
    Metric("planning_wall_median_ms", "planning [ms]", of_all_runs=True),
)


@dataclass(frozen=True)
class Spread:
    """Median, quartiles and the confidence interval of the median, of ``count`` values."""

    count: int
    median: float
    lower_quartile: float
    upper_quartile: float
    low: float
    high: float


@dataclass(frozen=True)
class Rate:
    """A share of successes, 0 to 1, with its confidence interval."""

    successes: int
    count: int
    low: float
    high: float

    @property
    def share(self) -> float:
        """Successes by runs."""
        return self.successes / self.count


@dataclass(frozen=True)
class Comparison:
    """A paired test of two variants.

    Attributes
    ----------
    pairs : int
        Seeds that count.
    difference : float
        Median of second minus first; for success the difference of the shares.
    p, corrected : float
        Of the test, and after Holm's correction; 1 where no pair differs.
    """

    first: str
    second: str
    metric: str
    pairs: int
    difference: float
    p: float
    corrected: float = 1.0


def spread_of(values: Sequence[float]) -> Spread | None:
    """Return median, quartiles and interval; None without values. The same values give the same numbers."""
    if not len(values):
        return None
    array = np.asarray(values, dtype=np.float64)
    low, high = np.quantile(_drawn_medians(array), [0.5 - CONFIDENCE / 2.0, 0.5 + CONFIDENCE / 2.0]).tolist()
    lower, median, upper = quartiles_of(values)
    return Spread(len(array), median, lower, upper, low, high)


def quartiles_of(values: Sequence[float]) -> tuple[float, float, float]:
    """Return lower quartile, median and upper quartile of at least one value."""
    lower, median, upper = np.quantile(np.asarray(values, dtype=np.float64), [0.25, 0.5, 0.75]).tolist()
    return lower, median, upper


def decimals_for(columns: Sequence[Sequence[float]]) -> int:
    """Return the decimals with which the largest median of these values has three digits; all of a column have these.

    >>> decimals_for([[63.7], [102.4]]), decimals_for([[0.145]]), decimals_for([[]])
    (0, 3, 2)
    """
    largest = max((abs(quartiles_of(values)[1]) for values in columns if len(values)), default=0.0)
    return max(0, 2 - math.floor(math.log10(largest))) if largest > 0.0 else 2


def pairs_needed(tests: int, p: float) -> int:
    """Return the fewest pairs with which one of so many tests can have a corrected p below ``p``.

    The least p of a test by changes of n signs is 2^(1 - n).
    """
    return next(pairs for pairs in itertools.count(1) if tests * 2.0 ** (1 - pairs) < p)


def _drawn_medians(array: FloatArray) -> FloatArray:
    """Medians (DRAWS,) of the values drawn again, in blocks, because all at once can take gigabytes."""
    rng, rows = np.random.default_rng(len(array)), max(1, BLOCK // len(array))
    blocks = [min(rows, DRAWS - first) for first in range(0, DRAWS, rows)]
    drawn = (array[rng.integers(0, len(array), (count, len(array)))] for count in blocks)
    return np.concatenate([np.median(block, axis=1) for block in drawn])


def rate_of(rows: Sequence[Row]) -> Rate:
    """Return the share of runs that are a success, of at least one run, with Wilson's interval."""
    n, successes = len(rows), sum(bool(row["success"]) for row in rows)
    share, z2 = successes / n, WILSON_Z * WILSON_Z
    centre = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = WILSON_Z / (1 + z2 / n) * math.sqrt(share * (1 - share) / n + z2 / (4 * n * n))
    return Rate(successes, n, max(0.0, min(share, centre - half)), min(1.0, max(share, centre + half)))


def values_of(rows: Sequence[Row], metric: Metric) -> list[float]:
    """Return the values of a metric in the runs that count."""
    return [float(row[metric.name]) for row in rows if _counts(row, metric)]


def compare_variants(rows: Sequence[Row]) -> list[Comparison]:
    """Return the tests of every two variants in success and in every metric that both have, corrected together."""
    variants = {name: {row["seed"]: row for row in rows if row["variant"] == name} for name in _names(rows)}
    found: list[Comparison] = []
    for first, second in itertools.combinations(variants, 2):
        seeds = sorted(variants[first].keys() & variants[second].keys())
        pairs = [(variants[first][seed], variants[second][seed]) for seed in seeds]
        if pairs:
            found += [_success(first, second, pairs), *_metrics(first, second, pairs)]
    return corrected(found)


def _names(rows: Sequence[Row]) -> list[str]:
    return sorted({row["variant"] for row in rows})


def _counts(row: Row, metric: Metric) -> bool:
    value = row.get(metric.name)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and (metric.of_all_runs or bool(row["success"]))


def _success(first: str, second: str, pairs: Sequence[tuple[Row, Row]]) -> Comparison:
    """McNemar's exact test."""
    from scipy.stats import binomtest

    gained = sum(bool(b["success"]) and not a["success"] for a, b in pairs)
    lost = sum(bool(a["success"]) and not b["success"] for a, b in pairs)
    p = float(binomtest(gained, gained + lost).pvalue) if gained + lost else 1.0
    return Comparison(first, second, "success", len(pairs), (gained - lost) / len(pairs), p)


def _metrics(first: str, second: str, pairs: Sequence[tuple[Row, Row]]) -> Iterator[Comparison]:
    for metric in METRICS:
        both = [(a, b) for a, b in pairs if _counts(a, metric) and _counts(b, metric)]
        if both:
            differences = np.array([float(b[metric.name]) - float(a[metric.name]) for a, b in both])
            p = signed_rank_p(differences)
            yield Comparison(first, second, metric.title, len(both), float(np.median(differences)), p)


def signed_rank_p(differences: FloatArray) -> float:
    """Two-sided p of Wilcoxon's signed-rank test by changes of signs; 1 where all are zero, or there is one only."""
    from scipy.stats import PermutationMethod, wilcoxon

    if len(differences) < 2 or not differences.any():
        return 1.0
    method = PermutationMethod(n_resamples=DRAWS, rng=np.random.default_rng(len(differences)))
    return float(wilcoxon(differences, zero_method="pratt", method=method).pvalue)


def corrected(tests: Sequence[Comparison]) -> list[Comparison]:
    """Return tests with Holm's correction.

    The smallest p is multiplied by the number of tests, the next one by one less, and so on; the products never fall.
    """
    by_index, largest = dict[int, float](), 0.0
    for rank, index in enumerate(sorted(range(len(tests)), key=lambda index: tests[index].p)):
        largest = max(largest, min(1.0, (len(tests) - rank) * tests[index].p))
        by_index[index] = largest
    return [replace(test, corrected=by_index[index]) for index, test in enumerate(tests)]
