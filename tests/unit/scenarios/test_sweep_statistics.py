"""What a sweep says about its runs: medians, intervals and tests, each tied to its definition written out."""

import itertools
import re
import statistics
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from terrain.scenarios.scenario import load_scenario
from terrain.sweeps.figures import write_figures
from terrain.sweeps.html_tables import decimals_of, html_table
from terrain.sweeps.latex import escaped, latex_table
from terrain.sweeps.report import write_tables
from terrain.sweeps.statistics import (
    DRAWS,
    METRICS,
    Comparison,
    compare_variants,
    corrected,
    decimals_for,
    pairs_needed,
    rate_of,
    signed_rank_p,
    spread_of,
    values_of,
)
from terrain.sweeps.sweep import SweepRun, run_once
from terrain.sweeps.terminal_tables import comparison_table, summary_table
from terrain.sweeps.variants import common_settings, short_names

NUMBERS = st.lists(st.integers(-6, 6), min_size=1, max_size=7)


def row(seed, variant="a", success=True, **numbers):
    level = "success" if success else "failed"
    values = {"time_s": 10.0 + seed, "path_length_m": 20.0, "spl": 0.9 if success else 0.0, **numbers}
    track = [[0.0, 0.0], [float(seed), 1.0]]
    return {"seed": seed, "variant": variant, "success": success, "level": level, "track": track, **values}


def p_of_all_signs(differences):
    """Wilcoxon's signed-rank test by its definition, zeros ranked with the others (Pratt): every choice of signs."""
    magnitudes = [abs(difference) for difference in differences]
    ranks = [
        sum(m < magnitude for m in magnitudes) + (sum(m == magnitude for m in magnitudes) + 1) / 2
        for magnitude in magnitudes
    ]
    ranked = [rank for rank, magnitude in zip(ranks, magnitudes, strict=True) if magnitude]
    positive = sum(rank for rank, difference in zip(ranks, differences, strict=True) if difference > 0)
    middle = sum(ranked) / 2
    sums = [sum(itertools.compress(ranked, signs)) for signs in itertools.product((0, 1), repeat=len(ranked))]
    return sum(abs(total - middle) >= abs(positive - middle) - 1e-9 for total in sums) / len(sums)


@settings(max_examples=25)
@given(differences=NUMBERS)
def test_the_signed_rank_test_is_that_of_all_choices_of_signs(differences):
    assert signed_rank_p(np.array(differences, dtype=float)) == pytest.approx(p_of_all_signs(differences))


@given(ps=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=6))
def test_holms_correction_rejects_exactly_what_the_stepwise_rule_rejects(ps):
    found = [test.corrected for test in corrected([Comparison("a", "b", "m", 5, 0.0, p) for p in ps])]

    for level in (0.01, 0.05, 0.3):
        rejected = 0
        for number, p in enumerate(sorted(ps)):  # the smallest first, until one is not rejected
            if p * (len(ps) - number) > level:
                break
            rejected += 1
        assert sum(value <= level for value in found) == rejected
    assert all(p <= value <= 1.0 for p, value in zip(ps, found, strict=True))


@settings(max_examples=20)
@given(values=st.lists(st.floats(-100.0, 100.0), min_size=1, max_size=9))
def test_the_median_has_its_quartiles_and_an_interval_that_repeats(values):
    spread = spread_of(values)

    assert spread == spread_of(values)
    assert spread.median == pytest.approx(statistics.median(values))
    assert spread.low <= spread.median + 1e-9 and spread.median <= spread.high + 1e-9
    assert min(values) <= spread.low and spread.high <= max(values)


def test_the_interval_of_the_median_is_that_of_runs_drawn_again():
    values = [float(number * number) for number in range(25)]
    rng = np.random.default_rng(5)
    medians = sorted(statistics.median(rng.choice(values, 25)) for _ in range(4000))

    spread = spread_of(values)

    assert (spread.low, spread.high) == (medians[100], medians[-101])


@given(successes=st.integers(0, 30), failures=st.integers(0, 30))
def test_the_interval_of_a_rate_is_where_the_rate_is_1_96_standard_errors_away(successes, failures):
    if successes + failures == 0:
        return
    n = successes + failures
    rate = rate_of([row(seed, success=seed < successes) for seed in range(n)])

    assert 0.0 <= rate.low <= rate.share <= rate.high <= 1.0
    for end in (rate.low, rate.high):
        if 0.0 < end < 1.0:
            assert abs(rate.share - end) == pytest.approx(1.96 * (end * (1 - end) / n) ** 0.5, rel=1e-3)


@pytest.mark.parametrize(("medians", "decimals"), [((63.7, 102.4), 0), ((0.145, 0.02), 3), ((), 2), ((0.0,), 2)])
def test_a_column_of_a_table_has_decimals_for_three_digits_of_its_largest_median(medians, decimals):
    assert decimals_for([[median] for median in medians]) == decimals


@pytest.mark.parametrize("tests", [1, 7, 21, 100])
def test_the_pairs_that_are_needed_are_the_fewest_that_all_point_to_one_side_with_such_a_p(tests):
    pairs = pairs_needed(tests, 0.05)
    assert tests * p_of_all_signs([1.0] * pairs) < 0.05 <= tests * p_of_all_signs([1.0] * (pairs - 1))


def test_a_sweep_with_few_seeds_reports_how_many_a_clear_difference_needs():
    rows = [row(seed, variant, spl=0.5 + 0.1 * (variant == "b")) for seed in range(4) for variant in "ab"]
    assert "with fewer than 8 seeds there can be none" in comparison_table(rows)
    many = [row(seed, variant) for seed in range(8) for variant in "ab"]
    assert "fewer" not in comparison_table(many)


def test_what_all_variants_share_is_not_in_their_names():
    first, second = "a.b={x: 1, y: z=2} backend=mesh planner=cvp", "a.b={x: 1, y: z=2} backend=mesh planner=astar"
    assert short_names([first, second]) == {first: "planner=cvp", second: "planner=astar"}
    assert common_settings([first, second])[-1] == "backend=mesh"
    assert short_names(["planner=cvp"]) == {"planner=cvp": "planner=cvp"} and common_settings(["planner=cvp"]) == []
    assert short_names([""]) == {"": "as written"}
    table = latex_table([row(0, first), row(0, second)])
    assert "planner=cvp & 100" in table and "% All variants have a.b=" in table and table.count("backend=mesh") == 1


def test_the_numbers_of_a_column_of_a_page_have_the_same_decimals_and_empty_columns_are_left_out():
    lines = [{"entry": "a", "time_s": 33.95, "why": ""}, {"entry": "b", "time_s": 34.0, "why": ""}]
    table = html_table(lines)
    assert "<td>33.95</td>" in table and "<td>34.00</td>" in table
    assert '<th class="">time [s]</th>' in table and "why" not in table
    assert [decimals_of(values) for values in ([2.825, 161.0], [20557.5, ""], [1.0, 0.996], ["-"])] == [1, 0, 3, 0]


def test_success_is_compared_by_the_seeds_in_which_one_of_two_succeeded():
    rows = [row(seed, "a", success=seed < 3) for seed in range(9)] + [row(seed, "b") for seed in range(1, 9)]

    test = next(test for test in compare_variants(rows) if test.metric == "success")

    assert (test.pairs, test.difference) == (8, 6 / 8)
    assert test.p == pytest.approx(2 * 0.5**6)


@pytest.mark.parametrize("variants", ["ab", "abc"])
def test_p_is_corrected_for_the_number_of_all_tests_of_a_sweep(variants):
    rows = [row(seed, name, time_s=10.0 * ord(name) + seed) for name in variants for seed in range(8)]

    tests = compare_variants(rows)

    assert len({test.metric for test in tests}) == 4, "success, SPL, time and length"
    smallest = min(tests, key=lambda test: test.p)
    assert 0.0 < smallest.p < 1.0
    assert smallest.corrected == pytest.approx(min(1.0, len(tests) * smallest.p))


def test_the_interval_of_many_runs_takes_little_memory():
    values = np.arange(1000.0)
    drawn = values[np.random.default_rng(1000).integers(0, 1000, (DRAWS, 1000))]
    low, high = np.quantile(np.median(drawn, axis=1), [0.025, 0.975])
    size = drawn.nbytes
    del drawn

    tracemalloc.start()
    spread = spread_of(values)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()

    assert (spread.low, spread.high) == (pytest.approx(low), pytest.approx(high)), "the same draws as all at once"
    assert peak < size / 2


def test_numbers_are_compared_on_seeds_in_which_both_succeeded_and_spl_on_all():
    rows = [row(seed, "a", time_s=10.0) for seed in range(6)]
    rows += [row(seed, "b", time_s=11.0 + seed, success=seed != 2) for seed in range(6)]

    tests = {test.metric: test for test in compare_variants(rows)}

    assert (tests["time [s]"].pairs, tests["time [s]"].difference) == (5, 4.0)
    assert tests["SPL"].pairs == 6
    assert tests["length [m]"].p == 1.0, "no pair differs"
    assert len(values_of(rows, METRICS[0])) == 12 and len(values_of(rows, METRICS[1])) == 11


@settings(max_examples=8)
@given(
    names=st.sets(st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), max_size=90), max_size=30),
    large=st.floats(1e-9, 1e12),
)
def test_tables_in_a_terminal_fit_80_columns_whatever_variants_are_called(names, large):
    rows = [row(seed, name, time_s=large * (1 + number)) for number, name in enumerate(names) for seed in range(2)]
    console = Console(width=80, file=None)

    tables = [table for table in (summary_table(rows), comparison_table(rows)) if table is not None]
    assert len(tables) == 1 + (len(names) > 1)
    for table in tables:
        assert console.measure(table).minimum <= 80
        lines = console.render_lines(table, console.options.update(width=80))
        assert all("…" not in segment.text for line in lines for segment in line)


def test_a_latex_table_has_as_many_cells_in_each_line_and_no_sign_of_latex():
    table = latex_table([row(0, "planner=a_b & 50%"), row(1, "planner=a_b & 50%"), row(0, r"path\to$x^2~{#}<>")])

    lines = [line for line in table.splitlines() if line.endswith(r"\\")]
    assert len({len(re.findall(r"(?<!\\)&", line)) for line in lines}) == 1
    assert r"planner=a\_b \& 50\%" in table and "(10.2--10.8)" in table
    assert r"\toprule" in table and r"\bottomrule" in table


@given(text=st.text(max_size=30))
def test_escaped_text_has_no_bare_sign_of_latex(text):
    bare = re.sub(r"\\(text\w+\{\}|[&%$#_{}])", "", escaped(text))

    assert not re.search(r"[&%$#_{}~^\\<>]", bare)


def test_all_files_of_a_sweep_are_the_same_bytes_each_time(tmp_path):
    rows = [row(seed, variant, success=seed > 0) for variant in ("a", "b", "") for seed in range(4)]
    written = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        files = write_tables("Trial", rows, folder)
        written.append({file.name: file.read_bytes() for file in files if file.suffix != ".parquet"})

    assert written[0] == written[1]
    tables = {"sweep.csv", "sweep.html", "summary.csv", "tests.csv", "sweep.tex"}
    assert set(written[0]) == tables | {"boxplots.pdf", "boxplots.svg", "tracks.pdf", "tracks.svg"}
    assert written[0]["sweep.html"].count(b"<svg") == 2


def test_runs_without_numbers_have_no_figures(tmp_path):
    failed = {"seed": 0, "variant": "a", "success": False, "level": "failed"}

    assert write_figures([failed], tmp_path) == []


SCENARIO = """
name: trial
proves: A few steps.
backend: costmap
navigation: {costmap: nav.yaml}
world: {type: generated, size: [6.0, 5.0], spacing: 0.5}
physics: kinematic
robot: turtlebot
start: {x: 2.0, y: 2.5}
goals: [{x: 3.5, y: 2.5}]
time_limit: 1.0
"""
NAVIGATION = """
backend: costmap
planners: [{name: dijkstra, type: dijkstra}]
controllers: [{name: pursuit, type: regulated_pure_pursuit}]
global_costmap: &map {robot_radius: 0.2, layers: [{name: walls, type: static}], walls: {map_file: $WORLD_MAP}}
local_costmap: *map
"""


def test_a_kept_run_has_its_folder_and_the_page_links_to_its_replay(tmp_path):
    (tmp_path / "trial.yaml").write_text(SCENARIO)
    (tmp_path / "nav.yaml").write_text(NAVIGATION)
    scenario = load_scenario(tmp_path / "trial.yaml")

    metrics = run_once((scenario, SweepRun(5, {"planner_patience": "2.0"})), tmp_path, "mbf sweep trial.yaml")

    folder = tmp_path / metrics["folder"]
    assert re.fullmatch(r"runs/planner_patience=2\.0_\w{6}/seed_5", metrics["folder"])
    assert {"replay.html", "scenario.yaml", "provenance.yaml"} <= {file.name for file in folder.iterdir()}
    assert 2 <= len(metrics["track"]) <= 200
    write_tables("Trial", [{**metrics, "seed": 5, "variant": "planner_patience=2.0"}], tmp_path)
    link = re.search(r'<a href="([^"]+)">replay</a>', (tmp_path / "sweep.html").read_text())
    assert link is not None and link[1].endswith("/seed_5/replay.html")
