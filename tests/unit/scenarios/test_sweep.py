"""Sweeps: what is run, what is remembered, what the tables say."""

import csv

import pytest
import typer

from mbf_abstract.config.findings import ConfigError
from terrain.scenarios.perturbation import Perturbation, draw_disturbance
from terrain.scenarios.places import PlanarPose
from terrain.scenarios.scenario import MapWorld, load_scenario
from terrain.sweeps.command import parse_seeds, parse_settings
from terrain.sweeps.log import SweepLog
from terrain.sweeps.report import summarise, write_tables
from terrain.sweeps.sweep import SweepRun, hash_of, is_done, plan_sweep, run_once, run_unless_refused


def row(seed, variant="planner=cvp", success=True, **more):
    numbers = {"time_s": 10.0 + seed, "path_length_m": 20.0, "incidents": ["slipping"] if seed else []}
    level = "success" if success else "failed"
    return {
        "seed": seed,
        "variant": variant,
        "success": success,
        "level": level,
        "outcome": "SUCCESS",
        **numbers,
        **more,
    }


def test_every_seed_meets_every_combination_of_settings():
    runs = plan_sweep([3, 4], {"planner": ["cvp", "dijkstra"], "backend": ["mesh"]})
    assert [run.seed for run in runs] == [3, 3, 4, 4]
    assert [run.variant for run in runs[:2]] == ["backend=mesh planner=cvp", "backend=mesh planner=dijkstra"]
    assert len({run.key("hash") for run in runs}) == 4


def test_the_key_of_a_run_does_not_depend_on_the_order_of_settings():
    assert SweepRun(1, {"a": "1", "b": "2"}).key("x") == SweepRun(1, {"b": "2", "a": "1"}).key("x")


def test_a_changed_scenario_or_configuration_has_another_hash(tmp_path):
    scenario = load_scenario("bridge")
    config = tmp_path / "nav.yaml"
    config.write_text("backend: mesh\n")
    hashes = {
        hash_of(scenario),
        hash_of(scenario.model_copy(update={"goals": ("south",)})),
        hash_of(scenario.model_copy(update={"navigation": {"mesh": config}})),
    }
    assert len(hashes) == 3
    assert hash_of(scenario) == hash_of(load_scenario("bridge"))


@pytest.fixture
def mapped(tmp_path):
    """A scenario in a building that is drawn in an image, which only the map's yaml names."""
    (tmp_path / "map.yaml").write_text("image: floor.png\nresolution: 0.1\norigin: [0, 0, 0]\n")
    (tmp_path / "floor.png").write_bytes(b"first")
    config = tmp_path / "nav.yaml"
    config.write_text("backend: costmap\nmasks: [{file: mask.png}, nav.yaml]\n")
    (tmp_path / "mask.png").write_bytes(b"first")
    world = MapWorld(type="map", file=tmp_path / "map.yaml")
    return load_scenario("bridge").model_copy(update={"world": world, "navigation": {"costmap": config}})


@pytest.mark.parametrize("file", ["map.yaml", "floor.png", "nav.yaml", "mask.png"])
def test_a_changed_file_that_the_world_or_a_configuration_names_has_another_hash(mapped, tmp_path, file):
    before = hash_of(mapped)
    assert hash_of(mapped) == before
    (tmp_path / file).write_bytes((tmp_path / file).read_bytes() + b"# changed")
    assert hash_of(mapped) != before


def test_a_changed_file_that_a_setting_names_is_another_run(tmp_path):
    file = tmp_path / "other.png"
    keys = set()
    for content in (b"first", b"second"):
        file.write_bytes(content)
        keys.add(SweepRun(1, {"world.file": str(file), "planner": "cvp"}).key("x"))
    assert len(keys) == 2


@pytest.mark.parametrize(
    "line", [b"nonsense", b"[1]", b'{"seed": 1}', b"\xff\xfe", b"", b'{"key": 5}', b'{"key": "a"}{"key": "b"}']
)
def test_a_damaged_line_is_named_with_its_number(tmp_path, line):
    file = tmp_path / "runs.jsonl"
    with SweepLog(file) as log:
        log.append("a", {"seed": 1})
    file.write_bytes(file.read_bytes() + line + b"\n" + file.read_bytes())
    with pytest.raises(ConfigError, match=r"runs\.jsonl:2: expected a JSON object with the text 'key'"):
        SweepLog(file)


def test_the_log_keeps_what_it_was_given_over_a_restart(tmp_path):
    with SweepLog(tmp_path / "runs.jsonl") as log:
        log.append("a", {"seed": 1})
        log.append("a", {"seed": 2})
    with SweepLog(tmp_path / "runs.jsonl") as log:
        assert log.rows == {"a": {"key": "a", "seed": 1}}


def test_a_run_that_is_done_again_is_kept_in_its_place(tmp_path):
    with SweepLog(tmp_path / "runs.jsonl") as log:
        log.append("a", {"seed": 1})
        log.forget("a")
    with SweepLog(tmp_path / "runs.jsonl") as log:
        assert list(log.rows) == ["a"], "nothing is lost by a kill before it is done again"
        log.forget("a")
        log.append("a", {"seed": 1, "folder": "runs/a"})
    with SweepLog(tmp_path / "runs.jsonl") as log:
        assert log.rows == {"a": {"key": "a", "seed": 1, "folder": "runs/a"}}


def test_a_run_that_cannot_begin_says_why_without_a_folder_that_has_another_name_each_time():
    job = load_scenario("crowded_corridor"), SweepRun(0, {"planer_patience": "3"})
    first, again = run_once(job), run_once(job)
    assert first == again and first["outcome"] == "ConfigError"
    assert "planer_patience: expected a known key" in first["message"]


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_a_mistake_in_a_configuration_is_named_in_the_file_of_the_user(backend, tmp_path):
    scenario = load_scenario("indoor")
    file = tmp_path / "mine.yaml"
    text = scenario.navigation[backend].read_text()
    file.write_text(f"# of a user\n{text}planer_patience: 3.0\n")
    job = scenario.model_copy(update={"navigation": {backend: file}}), SweepRun(0, {"backend": backend})

    row = run_once(job)

    line = len(file.read_text().splitlines())
    assert row["message"].startswith(f"{file}:{line}: planer_patience: expected a known key")
    assert "navigation.yaml" not in row["message"]


@pytest.mark.parametrize("known", [[], [{"variant": "speed=x", "refused": True, "message": "no"}]])
def test_settings_that_are_refused_are_tried_once_and_known_for_all_their_seeds(known):
    tried = []

    def do(job):
        tried.append(job)
        refused = job[1].variant == "speed=x"
        return {"variant": job[1].variant, "refused": refused, "message": "no" if refused else ""}

    def spread(jobs, wanted):
        return ((job, do(job)) for job in filter(wanted, jobs))

    jobs = [(None, run) for run in plan_sweep(range(5), {"speed": ["x", "1"]})]
    rows = list(run_unless_refused(jobs, known, spread))

    assert sorted(job[1].key("") for job, _ in rows) == sorted(job[1].key("") for job in jobs)
    assert len(tried) == 5 + (not known)
    assert all(row["message"] == ("no" if job[1].variant == "speed=x" else "") for job, row in rows)


def test_a_start_that_the_seed_has_drawn_off_the_ground_refuses_no_other_seed():
    scenario = load_scenario("outdoor")
    start = PlanarPose(x=0.1, y=0.1)
    shifted = scenario.model_copy(update={"start": start, "perturb": Perturbation(start_position=5.0)})
    off = scenario.model_copy(update={"start": PlanarPose(x=-5.0, y=0.0)})
    seed = next(seed for seed in range(9) if draw_disturbance(shifted.perturb, seed).dx < -1.0)

    drawn, written = (run_once((one, SweepRun(seed))) for one in (shifted, off))

    assert (drawn["outcome"], drawn["refused"]) == ("DrawnError", False)
    assert (written["outcome"], written["refused"]) == ("ConfigError", True)
    assert written["verdict"].startswith("refused with every seed: scenario:1: start or goals: expected a place on the")


@pytest.mark.parametrize(
    ("known", "done", "done_and_kept"),
    [
        (None, False, False),
        ({"track": []}, True, False),
        ({"track": [], "folder": "runs/a"}, True, True),
        ({"outcome": "ConfigError"}, True, True),
    ],
)
def test_runs_that_were_done_without_their_folders_are_done_again_if_folders_are_to_be_kept(known, done, done_and_kept):
    assert (is_done(known, keep=False), is_done(known, keep=True)) == (done, done_and_kept)


@pytest.mark.parametrize("length", [1, 10, 17])
def test_a_line_that_was_cut_short_is_taken_away_and_written_again(tmp_path, length):
    file = tmp_path / "runs.jsonl"
    with SweepLog(file) as log:
        log.append("a", {"seed": 1})
    whole = file.read_bytes()
    file.write_bytes(whole + b'{"key": "b", "seed": 2}'[:length])
    with SweepLog(file) as log:
        assert list(log.rows) == ["a"]
        log.append("b", {"seed": 2})
    assert file.read_bytes() == whole + b'{"key": "b", "seed": 2}\n'


def test_the_csv_has_one_row_per_run_sorted_by_variant_and_seed(tmp_path):
    rows = [row(1, level="arrived", success=False), row(0), row(0, "planner=astar", success=False)]
    files = write_tables("Trial <1>", rows, tmp_path)
    with files[0].open() as file:
        table = list(csv.DictReader(file))
    assert [(line["variant"], line["seed"]) for line in table] == [
        ("planner=astar", "0"),
        ("planner=cvp", "0"),
        ("planner=cvp", "1"),
    ]
    page = files[1].read_text()
    assert "Trial &lt;1&gt;" in page
    assert [page.count(f'<tr class="{level}">') for level in ("success", "arrived", "failed")] == [1, 1, 1]


def test_a_run_that_could_not_begin_has_a_row_too(tmp_path):
    rows = [{"seed": 0, "variant": "planner=none", "success": False, "level": "failed", "outcome": "ConfigError"}]
    write_tables("Trial", rows, tmp_path)
    assert "ConfigError" in (tmp_path / "sweep.csv").read_text()
    assert summarise(rows)[0]["success_percent"] == 0.0


def test_the_summary_counts_arrivals_with_failures_beside_successes():
    (line,) = summarise([row(0), row(1, success=False, level="arrived"), row(2, success=False)])
    assert (line["success_percent"], line["arrived_with_failures"]) == (33.3, 1)


def test_the_summary_counts_per_variant_and_takes_medians_of_successes():
    rows = [
        row(0),
        row(1, path_over_geodesic=1.1, collisions=2),
        row(2, success=False, tip_overs=1),
        row(0, "planner=astar", success=False),
    ]
    lines = {line["variant"]: line for line in summarise(rows)}
    assert lines["planner=cvp"]["success_percent"] == 66.7
    assert lines["planner=cvp"]["median_time_s"] == 10.5
    assert lines["planner=cvp"]["median_path_over_geodesic"] == 1.1
    assert (lines["planner=cvp"]["collisions"], lines["planner=cvp"]["tip_overs"]) == (2, 1)
    assert lines["planner=cvp"]["runs_with_incidents"] == 2
    assert lines["planner=astar"]["median_time_s"] == ""


def test_the_summary_takes_spl_over_all_runs_and_the_median_of_the_closest_distances():
    rows = [
        row(0, spl=0.9, clearance_min_m=0.2),
        row(1, spl=0.0, success=False, clearance_min_m=0.1),
        row(2, spl=None),
    ]
    (line,) = summarise(rows)
    assert (line["mean_spl"], line["median_clearance_m"]) == (0.45, 0.15)


@pytest.mark.parametrize(("text", "seeds"), [("0:3", [0, 1, 2]), ("7", [7]), ("1,5", [1, 5])])
def test_seeds_are_a_range_or_a_list(text, seeds):
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "3:3", "a", "1,1", "-1,2", "1:2:3"])
def test_nonsense_for_seeds_is_refused(text):
    with pytest.raises(typer.BadParameter, match="expected 0:20 or 1,5,9") as refused:
        parse_seeds(text, "--levels")
    assert refused.value.param_hint == "--levels"


def test_settings_list_their_values_and_nonsense_is_refused():
    assert parse_settings(["planner=cvp,astar", "a.b=1"]) == {"planner": ["cvp", "astar"], "a.b": ["1"]}
    for *texts, message in (
        ("planner", "each value once, got 'planner'"),
        ("=1", "each value once"),
        ("planner=", "each value once"),
        ("planner=a,", "each value once"),
        ("planner=a,b,a", "each value once, got 'planner=a,b,a'"),
        ("planner=a", "planner=b", "each key once, with all its values, got 'planner=b'"),
    ):
        with pytest.raises(typer.BadParameter, match=message) as refused:
            parse_settings(texts)
        assert refused.value.param_hint == "--set"
