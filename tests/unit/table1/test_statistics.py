"""Ratios with their intervals, and the mix of recoveries."""

import math
from collections import Counter

import numpy as np
import pytest

from terrain.experiments.table1.statistics import clear_share, entropy, paired_ratio, wilcoxon_p


def test_equal_pairs_have_a_ratio_of_one_without_spread():
    ratio = paired_ratio([3.0, 5.0, 8.0], [3.0, 5.0, 8.0])
    assert (ratio.value, ratio.low, ratio.high) == (1.0, 1.0, 1.0)


def test_the_interval_is_that_of_a_naive_bootstrap():
    rng = np.random.default_rng(0)
    a, b = rng.uniform(50, 150, 10), rng.uniform(20, 40, 10)
    draws = [rng.integers(10, size=10) for _ in range(4000)]
    naive = np.percentile([a[d].sum() / b[d].sum() for d in draws], [2.5, 97.5])
    ratio = paired_ratio(a, b)
    assert ratio.value == pytest.approx(a.sum() / b.sum())
    assert [ratio.low, ratio.high] == pytest.approx(naive, rel=0.03)


def test_pairs_stay_together():
    assert paired_ratio([10.0, 1000.0], [1.0, 100.0]).high == pytest.approx(10.0)


def test_nothing_in_condition_b_gives_an_infinite_ratio():
    assert paired_ratio([2.0, 3.0], [0.0, 0.0]).value == math.inf


@pytest.mark.parametrize(("a", "b"), [([], []), ([1.0], [1.0, 2.0])])
def test_numbers_that_are_no_pairs_are_refused(a, b):
    with pytest.raises(ValueError, match="pairs are needed"):
        paired_ratio(a, b)


def test_the_papers_own_mixes_have_the_entropies_and_shares_of_the_notes():
    move_base = Counter(clear_costmaps=175, out_of_collision=6, relax_controller=4, relax_planner=7, escape_distance=2)
    tree = Counter(clear_costmaps=93, out_of_collision=46, relax_controller=31, relax_planner=10)
    assert entropy(move_base) == pytest.approx(0.646, abs=5e-4)
    assert entropy(tree) == pytest.approx(1.664, abs=5e-4)
    assert (clear_share(move_base), clear_share(tree)) == pytest.approx((0.902, 0.517), abs=5e-4)


def test_equal_times_are_no_evidence_and_ten_shorter_ones_are():
    times = np.linspace(400.0, 500.0, 10)
    assert wilcoxon_p(times, times) == 1.0
    assert wilcoxon_p(times, times - np.arange(1.0, 11.0)) < 0.01
