"""Difficulty curves count the runs at each value of a number, and are drawn where there are several values."""

from collections import defaultdict

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrain.experiments.evaluation.levels import curves_of_levels
from terrain.sweeps.difficulty import curves_of_settings
from terrain.sweeps.figures import write_difficulty, write_figures

VALUES = ("0.25", "0.5", "1e1")
RUNS = st.lists(
    st.tuples(st.sampled_from(("cvp", "astar")), st.sampled_from(VALUES), st.sampled_from(("3", "6")), st.booleans()),
    min_size=1,
    max_size=30,
)


def row(variant, success=True, **more):
    return {"variant": variant, "seed": 0, "success": success, "level": "success", "spl": 0.5 * success, **more}


@given(runs=RUNS)
def test_every_run_counts_once_in_the_curve_of_its_planner_over_each_number(runs):
    """The naive twin counts run by run."""
    rows = [row(f"planner={planner} world.slope={slope} world.step={step}", ok) for planner, step, slope, ok in runs]
    counted = defaultdict(list)
    for planner, step, slope, ok in runs:
        counted["world.step", planner, float(step)].append(ok)
        counted["world.slope", planner, float(slope)].append(ok)
    planners = {planner for planner, *_ in runs}

    curves = curves_of_settings(rows)

    several = {key for key in ("world.step", "world.slope") if len({v for k, _, v in counted if k == key}) > 1}
    assert set(curves) == several
    for key, of_key in curves.items():
        assert len(of_key) == len(planners)
        for curve in of_key:
            found = [planner for planner in planners if planner in curve.name] or list(planners)
            assert [point.value for point in curve.points] == sorted(
                value for k, planner, value in counted if (k, planner) == (key, found[0])
            )
            for point in curve.points:
                ok = counted[key, found[0], point.value]
                assert (point.success.successes, point.success.count) == (sum(ok), len(ok))
                assert point.spl == pytest.approx(0.5 * sum(ok) / len(ok))


@pytest.mark.parametrize(
    "values", [("on", "0.5"), ("1", "inf"), ("1", "nan"), ("1", "1.0"), ("[1, 2]", "3")], ids=lambda v: "_".join(v)
)
def test_a_setting_without_several_finite_numbers_has_no_curve(values, tmp_path):
    rows = [row(f"world.x={value}", track=[[0.0, 0.0], [1.0, 1.0]]) for value in values]

    assert curves_of_settings(rows) == {}
    assert {file.stem for file in write_figures(rows, tmp_path)} == {"boxplots", "tracks"}


def test_a_run_without_spl_counts_in_the_successes_only():
    rows = [row("x=1", spl=None), row("x=1", spl=0.4), row("x=2", spl=None)]

    (curve,) = curves_of_settings(rows)["x"]

    assert [(point.success.count, point.spl) for point in curve.points] == [(2, 0.4), (1, None)]


def test_the_figure_names_the_values_and_the_curves_and_is_the_same_each_time(tmp_path):
    rows = [row(f"planner={planner} x={x}", x < 2) for planner in ("mine", "theirs") for x in (0.5, 1, 2)]
    written = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        files = write_difficulty(curves_of_settings(rows), folder)
        written.append({file.name: file.read_bytes() for file in files})

    assert written[0] == written[1]
    svg = written[0]["difficulty.svg"].decode()
    for text in ("0.5", "planner=mine", "planner=theirs", "mean SPL", "success"):
        assert f"<!-- {text} -->" in svg


def test_levels_of_an_evaluation_are_counted_in_worlds_with_a_route():
    worlds = [
        ("level 0", True, True),
        ("level 3, blind", True, False),
        ("level 3, blind", False, True),
        ("tor", True, True),
    ]
    rows = [
        {"entry": entry, "world": world, "route": route, "success": ok, "spl": 0.9 * ok}
        for entry in ("mine", "other")
        for world, route, ok in worlds
    ]

    curves = curves_of_levels(rows, ["mine", "other", "not driven"])["level"]

    assert [curve.name for curve in curves] == ["mine", "other"]
    assert [(p.value, p.success.successes, p.success.count) for p in curves[0].points] == [(0.0, 1, 1), (3.0, 0, 1)]
    assert curves_of_levels([one for one in rows if one["world"] == "level 0"], ["mine"]) == {}


def test_many_variants_with_long_names_leave_room_for_every_panel(tmp_path, recwarn):
    names = [
        f"planner=any_angle controller=path_follower world.spacing={x} world.median_slope={y}"
        for x in range(6)
        for y in range(3)
    ]
    rows = [row(name, time_s=10.0, track=[[0.0, 0.0], [9.0, 1.0]]) for name in names]

    write_figures(rows, tmp_path)

    assert [str(warning.message) for warning in recwarn] == []
