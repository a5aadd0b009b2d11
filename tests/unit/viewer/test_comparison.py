"""Runs side by side, on a page and in the terminal."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from terrain.commands.compare import names_of
from terrain.recording.metrics import measure
from terrain.viewer.reports.comparison import compare_metrics, comparison_html


def compare(*arguments):
    return CliRunner(env={"COLUMNS": "120"}).invoke(make_app(), ["compare", *map(str, arguments)])


def test_the_page_has_both_runs_in_two_columns_and_needs_nothing_else(hill_recording, office_recording):
    runs = [(run, measure(run).to_json()) for run in (hill_recording, office_recording)]

    page = comparison_html(("first", "second"), runs)

    assert page.count("<img") == 2 and page.count("<svg") == 4
    for text in ("hill on mesh", "office on costmap", "BLOCKED_PATH: a box stands on the path", "<th>second</th>"):
        assert text in page
    assert "<script" not in page and re.findall(r'(?:src|href)="(?!data:|#)', page) == []


def test_differences_are_right_minus_left_and_only_of_numbers():
    left = {
        "time_s": 10.0,
        "success": True,
        "incidents": [],
        "plans": 3,
        "energy_j": 5.0,
        "limit": None,
        "work_j": 20000.0,
    }
    right = {
        "time_s": 12.5,
        "success": False,
        "incidents": ["collision"],
        "plans": 3,
        "wall_time_s": 1.0,
        "limit": None,
        "work_j": 21234.5,
    }

    assert compare_metrics([left, right]) == [
        ("time [s]", "10", "12.5", "+2.5"),
        ("success", "yes", "no", "differs"),
        ("incidents", "none", "collision", "differs"),
        ("plans", "3", "3", "0"),
        ("energy [J]", "5", "-", "differs"),
        ("limit", "-", "-", ""),
        ("work [J]", "20000", "21234", "+1234"),
        ("wall time [s]", "-", "1", "differs"),
    ]


def test_the_command_prints_a_table_and_writes_the_page(hill_recording, office_recording, tmp_path):
    for name, run in (("before", hill_recording), ("after", office_recording)):
        (tmp_path / name).mkdir()
        run.save(tmp_path / name / "recording.npz")
    (tmp_path / "after" / "metrics.json").write_text(json.dumps({"slipped_m": 0.25}))

    result = compare(tmp_path / "before", tmp_path / "after", "--out", tmp_path / "page.html")

    assert result.exit_code == 0, result.output
    lines = [re.split(r"\s*│\s*", line.strip("│ ")) for line in result.stdout.splitlines()]
    assert ["slipped [m]", "-", "0.25", "differs"] in lines
    assert any(line[0] == "control cycles" and line[1:] == ["500", "500", "0"] for line in lines)
    assert "hill on mesh" in (tmp_path / "page.html").read_text()


def test_a_folder_without_a_run_is_exit_code_2(tmp_path):
    result = compare(tmp_path, tmp_path)

    assert result.exit_code == 2 and "recording.npz" in result.output


def test_equal_digests_are_one_drive_and_equal_numbers_are_not(hill_recording, tmp_path):
    for name, digest in (("first", "ab"), ("again", "ab"), ("other", "cd"), ("old", None)):
        (tmp_path / name).mkdir()
        hill_recording.save(tmp_path / name / "recording.npz")
        (tmp_path / name / "metrics.json").write_text(json.dumps({"digest": digest} if digest else {}))

    def reported(name):
        return compare(tmp_path / "first", tmp_path / name, "--out", tmp_path / "page.html").stdout

    assert "digest: equal" in reported("again") and "digest: equal" in (tmp_path / "page.html").read_text()
    assert "digest: differs" in reported("other")
    assert "digest: at least one run has none" in reported("old")


def test_any_number_of_runs_is_compared_in_80_columns(hill_recording, office_recording, tmp_path):
    digests = ("ab", "cd", "ab", "ef")
    for number, digest in enumerate(digests):
        folder = tmp_path / f"a_run_with_quite_a_long_name_{number}"
        folder.mkdir()
        (hill_recording if digest == "ab" else office_recording).save(folder / "recording.npz")
        numbers = {"digest": digest * 32, "path_length_m": 20.0 + number, "seed": number}
        (folder / "metrics.json").write_text(json.dumps(numbers))
    folders = sorted(tmp_path.iterdir())

    result = CliRunner(env={"COLUMNS": "80"}).invoke(
        make_app(), ["compare", *map(str, folders), "--out", str(tmp_path / "page.html")]
    )

    assert result.exit_code == 0, result.output
    tables = [line for line in result.stdout.splitlines() if line.startswith(("│", "┃", "┏", "└"))]
    assert tables and max(map(len, tables)) <= 80
    assert "…" not in result.stdout
    same = "a_run_with_quite_a_long_name_0, a_run_with_quite_a_long_name_2"
    assert f"only these are the same drive: {same}" in result.stdout
    values = [re.split(r"\s*│\s*", line.strip("│ ")) for line in tables]
    assert ["driven length [m]", "20", "21", "22"] in values and ["driven length [m]", "23"] in values
    assert (tmp_path / "page.html").read_text().count("<img") == 4


def test_one_run_alone_is_refused(tmp_path):
    result = compare(tmp_path)

    assert result.exit_code == 2 and "two or more folders" in result.output


def test_a_folder_of_seeds_is_refused_with_the_name_of_a_run_in_it(hill_recording, tmp_path):
    for variant in ("planner=cvp", "planner=astar"):
        for seed in range(3):
            (folder := tmp_path / variant / f"seed_{seed}").mkdir(parents=True)
            hill_recording.save(folder / "recording.npz")

    result = compare(tmp_path / "planner=cvp", tmp_path / "planner=astar")
    of_one_seed = compare(*tmp_path.glob("*/seed_1"), "--out", tmp_path / "page.html")

    assert result.exit_code == 2
    for words in ("holds 3", str(tmp_path / "planner=cvp" / "seed_0"), "sweep.html"):
        assert words in " ".join(result.output.split())
    assert of_one_seed.exit_code == 0 and "planner=cvp: SUCCESS" in of_one_seed.stdout


@pytest.mark.parametrize(
    ("folders", "names"),
    [
        (("a/first", "b/second"), ["first", "second"]),
        (("runs/a/seed_0", "runs/b/seed_0"), ["a", "b"]),
        (("runs/a/seed_0", "runs/a/seed_1", "runs/b/seed_0"), ["a/seed_0", "a/seed_1", "b/seed_0"]),
        (("x/run", "y/x/run"), ["x", "y/x"]),
    ],
)
def test_runs_are_named_by_what_distinguishes_their_folders(folders, names, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert names_of([Path(folder) for folder in folders]) == names
