"""The protocols of ``mbf bench``: frozen, every room with a route; and how their runs are ranked."""

from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.plugins import PluginKind
from terrain.experiments.evaluation.entrant import configuration_of, entrant
from terrain.experiments.evaluation.indoor import (
    BEFORE,
    CELL,
    LENGTH,
    RESOLUTION,
    WIDTH,
    draw_posts,
    has_passage,
    indoor,
)
from terrain.experiments.evaluation.joining import join
from terrain.experiments.evaluation.leaderboard import page, standings, terminal_table
from terrain.experiments.evaluation.moving import APART, HALL, START, draw_walkers, moving, place_on
from terrain.experiments.evaluation.outdoor import outdoor
from terrain.experiments.evaluation.protocol import Entry, Trial
from terrain.experiments.evaluation.results import (
    Results,
    comparable,
    described,
    read_results,
    results_of,
    shipped_results,
    write_results,
)
from terrain.experiments.evaluation.trials import Task, failure_of, lost_row, run_trials, task_key
from terrain.session.arrival import arrival_tolerance
from terrain.sweeps.guarded_workers import Lost
from terrain.sweeps.log import SweepLog
from terrain.worlds.occupancy import read_occupancy

OUTDOOR, INDOOR = outdoor([0]), indoor([0])
MOVING, BLIND = moving([0]), moving([0], people="blind")


def row(entry, world="level 0", route=True, failure="", spl=1.0, message="", **more):
    success = not failure
    times = {"time_s": 20.0, "planning_wall_median_ms": 3.0} | more
    return {
        **{"entry": entry, "world": world, "seed": 0, "trial": "t", "route": route, "success": success},
        **{"failure": failure, "spl": spl if success else 0.0, "message": message, "verdict": message},
        **{"outcome": "SUCCESS" if success else "NO_PATH_FOUND", **times},
    }


def test_version_1_is_frozen():
    """Whoever changes a world, a configuration or a rule makes a version 2; a key of another name keeps the hash."""
    assert (OUTDOOR.hash, INDOOR.hash) == ("aa2b3979e61c", "f450f9248d20")
    assert (MOVING.hash, BLIND.hash) == ("e5078dccb479", "6e987a3325bd")


@pytest.mark.parametrize("protocol", [OUTDOOR, INDOOR, MOVING], ids=lambda protocol: protocol.name)
def test_the_judge_has_a_tolerance_of_its_own_and_no_verdict_is_by_wall_time(protocol):
    scenario = protocol.trials[0].scenario
    assert all(trial.scenario.limits == scenario.limits for trial in protocol.trials)
    for backend in scenario.navigation:
        frozen = configuration_of(protocol, backend, {})[0].parameters
        changed = configuration_of(protocol, backend, {"dist_tolerance": "5.0"})[0].parameters
        allowed, _ = arrival_tolerance(scenario.limits, scenario.localization, changed)
        assert (allowed, changed.dist_tolerance) == (frozen.dist_tolerance, 5.0)
        assert frozen.hang_guard > 86400.0, "longer than any --time-limit"


def test_a_planner_of_a_user_has_the_controller_of_the_shipped_one_on_the_flat_map():
    mine, _ = configuration_of(OUTDOOR, "costmap", {"planner": "theta_star"})
    shipped, _ = configuration_of(OUTDOOR, "costmap", OUTDOOR.entry("flat_astar").settings)
    of_mine, of_shipped = (
        [spec.parameters for spec in config.plugins if spec.kind is PluginKind.CONTROLLER] for config in (mine, shipped)
    )
    assert of_mine == of_shipped != []


def test_a_hash_changes_with_the_rules_and_the_seed_but_not_with_the_shipped_entries():
    assert replace(OUTDOOR, entries={}).hash == OUTDOOR.hash
    assert replace(OUTDOOR, rules={}).hash != OUTDOOR.hash
    first = OUTDOOR.trials[0]
    assert replace(OUTDOOR, trials=[Trial(first.scenario, 1)]).hash != replace(OUTDOOR, trials=[first]).hash


def test_the_comments_of_a_configuration_do_not_count(tmp_path):
    def with_mesh(text):
        file = tmp_path / "mesh.yaml"
        file.write_text(text)
        scenario = OUTDOOR.trials[0].scenario.model_copy(update={"navigation": {"mesh": file}})
        return replace(OUTDOOR, trials=[Trial(scenario, 0)]).hash

    assert with_mesh("a: 1\n") == with_mesh("# a remark\na: 1   # one\n") != with_mesh("a: 2\n")


def test_seeds_draw_different_rooms_and_a_higher_level_has_more_posts():
    rooms = [draw_posts(level, seed) for level in (0, 9) for seed in (0, 1)]
    assert len({posts.tobytes() for posts in rooms}) == 4
    assert max(map(len, rooms[:2])) < min(map(len, rooms[2:]))
    assert draw_posts(9, 1).tobytes() == rooms[3].tobytes()


@pytest.mark.parametrize("seed", range(6))
def test_a_room_has_a_passage_if_a_disc_that_is_moved_cell_by_cell_gets_through(seed):
    rng = np.random.default_rng(seed)
    posts = (np.argwhere(rng.random((26, 16)) < 0.14) + 0.5) * CELL
    radius = 0.28
    x = np.arange(-BEFORE, LENGTH + BEFORE, RESOLUTION) + 0.5 * RESOLUTION
    y = np.arange(0.0, WIDTH, RESOLUTION) + 0.5 * RESOLUTION
    apart = np.min(np.hypot(x[:, None, None] - posts[:, 0], y[None, :, None] - posts[:, 1]), axis=2)
    free = (apart >= radius + 0.5 * CELL) & (y >= radius) & (y <= WIDTH - radius)
    start, goal = (round(0.75 / RESOLUTION), len(y) // 2), (len(x) - 1 - round(0.75 / RESOLUTION), len(y) // 2)
    seen, front = {start} if free[start] else set(), [start]
    while front and seen:
        i, j = front.pop()
        around = [(i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
        new = [n for n in around if n not in seen and 0 <= n[0] < len(x) and 0 <= n[1] < len(y) and free[n]]
        seen.update(new)
        front += new
    assert has_passage(posts, radius) == (goal in seen)


def test_the_floor_plan_of_the_hall_is_in_the_hash_with_its_picture(tmp_path):
    def hash_of(picture):
        (tmp_path / "hall.yaml").write_bytes(HALL.read_bytes())
        (tmp_path / "hall.png").write_bytes(picture)
        scenario = MOVING.trials[0].scenario
        world = scenario.world.model_copy(update={"file": tmp_path / "hall.yaml"})
        return replace(MOVING, trials=[Trial(scenario.model_copy(update={"world": world}), 0)]).hash

    picture = HALL.with_suffix(".png").read_bytes()
    assert hash_of(picture) == moving([0], [0]).hash != hash_of(picture + b"another wall")


def test_both_parts_have_the_same_people_who_look_in_one_and_not_in_the_other():
    for trial, blind in zip(MOVING.trials, BLIND.trials, strict=True):
        looking = [walker.model_copy(update={"blind": False}) for walker in blind.scenario.actors]
        assert list(trial.scenario.actors) == looking != list(blind.scenario.actors)


def test_a_higher_level_has_more_people_other_seeds_draw_others_and_nobody_begins_at_the_robot():
    grid = read_occupancy(HALL)
    for level in (0, 5, 9):
        for seed in range(4):
            walkers = draw_walkers(level, seed, False, grid)
            assert len(walkers) == 2 + level
            assert walkers == draw_walkers(level, seed, False, grid) != draw_walkers(level, seed + 1, False, grid)
            for walker in walkers:
                x, y = place_on(np.array(walker.route), walker.start)
                assert np.hypot(x - START[0], y - START[1]) >= APART


@pytest.mark.parametrize("along", [0.0, 0.7, 3.0, 11.9, 12.0, 13.5, 40.2])
def test_a_place_on_a_closed_route_is_where_one_gets_to_in_small_steps(along):
    route = [(0.0, 0.0), (3.0, 0.0), (3.0, 4.0)]  # 3 + 4 + 5 m
    here, at, left = np.array(route[0]), 1, along
    while left > 1e-9:
        to = np.array(route[at % 3]) - here
        step = min(left, 0.01, float(np.hypot(*to)))
        here, left = here + to / np.hypot(*to) * step, left - step
        at += np.hypot(*(np.array(route[at % 3]) - here)) < 1e-9
    assert place_on(np.array(route), along) == pytest.approx(here, abs=1e-6)


def test_contacts_and_near_misses_have_columns_where_there_are_some_and_an_old_result_has_none():
    counted = {"collisions_while_moving": 1, "near_misses": 3}
    rows = [row("a", failure="contact", **counted), row("a", "level 1", **counted), row("old"), row("old", "level 1")]
    rows += [row("b", **dict.fromkeys(counted, 0)), row("b", "level 1", failure="error")]
    lines = {line.entry: line for line in standings(rows, 2)}
    counts = {name: (line.contacts, line.near_misses) for name, line in lines.items()}
    assert counts == {"a": (2, 6), "old": (None, None), "b": (0, 0)}
    entries = {name: {"backend": "mesh", "settings": {}} for name in lines}
    assert "near misses" in page("title", [], rows, list(lines.values()), set(), entries)
    assert "near misses" not in page("title", [], rows[2:4], [lines["old"], lines["b"]], set(), entries)
    console = Console(width=80, file=StringIO())
    console.print(terminal_table(list(lines.values()), "title"))
    assert "contacts" in console.file.getvalue() and "misses" in console.file.getvalue()


def test_the_more_successes_the_better_then_the_shorter_way_and_half_a_result_has_no_rank():
    rows = [row("slow", spl=0.5), row("slow", "level 1", spl=0.5)]
    rows += [row("fast"), row("fast", "level 1"), row("same"), row("same", "level 1"), row("half")]
    rows += [row("bad"), row("bad", "level 1", failure="planner", message="no <idea>")]
    lines = standings(rows, trials=2)
    assert [(line.entry, line.rank) for line in lines] == [
        ("fast", 1),
        ("same", 1),
        ("slow", 3),
        ("bad", 4),
        ("half", None),
    ]
    assert (lines[3].arrived, lines[3].share, lines[3].failures, lines[3].reason) == (
        1,
        0.5,
        {"planner": 1},
        "no <idea>",
    )
    entries = {line.entry: {"backend": "mesh", "settings": {"planner": line.entry, "key": "[1]"}} for line in lines}
    shown = page("title", ["about"], rows, lines, {"bad"}, entries)
    assert "key=[1] planner=bad" in shown
    assert "no &lt;idea&gt;" in shown and "<idea>" not in shown
    assert terminal_table(lines, "title").row_count == 5


def test_a_world_without_a_route_counts_for_nobody():
    (line,) = standings(
        [row("a", route=False, failure="planner"), row("a", "level 1"), row("a", "level 2", route=False)], 3
    )
    assert (line.arrived, line.with_route, line.runs, line.share, line.arrived_without_route) == (1, 1, 3, 1.0, 1)


def test_only_runs_of_the_same_trials_are_comparable(tmp_path):
    trial = INDOOR.trials[0]
    mine = row("a") | {"trial": INDOOR.trial_hash(trial)}
    results = results_of(INDOOR, [Entry("a", "costmap")], [mine, row("a")], "mbf bench indoor")
    write_results(results, tmp_path / "results.json")
    again = read_results(tmp_path / "results.json")
    assert again == results and again.head["protocol"]["hash"] == INDOOR.hash
    assert comparable(again, INDOOR) == [mine]
    assert comparable(Results({}, [mine]), OUTDOOR) == []


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"runs": 3, "protocol": {}}'])
def test_a_file_that_is_no_result_is_refused(tmp_path, text):
    (tmp_path / "mine.json").write_text(text)
    with pytest.raises(ConfigError, match=r"mine.json:1: .*expected"):
        read_results(tmp_path / "mine.json")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"time_s": "fast"}, r"runs\[0\].time_s: expected a number .*, got 'fast'"),
        ({"spl": float("nan")}, "expected"),
        ({"spl": 2.0}, r"runs\[0\].spl: expected a number >= 0 and <= 1"),
        ({"failure": "[/b]"}, r"runs\[0\].failure: .*got '\[/b\]'"),
        ({"message": ["a"]}, r"runs\[0\].message: "),
        ({"time_s": None}, "a time and no failure for a success"),
        ({"success": False}, "a failure otherwise"),
        ({"entry": "b"}, "runs of the file's entries, but 'b' is none"),
        ({"trial": "again"}, "'a' has two in one"),
    ],
)
def test_a_run_of_somebody_else_that_is_none_is_refused_with_its_key(tmp_path, change, expected):
    runs = [row("a") | change, row("a") | {"trial": "again"}]
    write_results(results_of(INDOOR, [Entry("a", "costmap")], runs, "mbf bench indoor"), tmp_path / "mine.json")
    with pytest.raises(ConfigError, match=expected):
        read_results(tmp_path / "mine.json")


def test_two_entries_of_one_name_have_a_line_each_and_one_that_is_the_same_has_one():
    def results(**settings):
        runs = [row("a") | {"trial": trial} for trial in (INDOOR.trial_hash(INDOOR.trials[0]), "of another protocol")]
        return results_of(INDOOR, [Entry("a", "costmap", settings)], runs, "mbf bench indoor")

    mine, others = results(planner="x"), {"same.json": results(planner="x"), "b.json": results(planner="y")}
    table = join(Results(mine.head, mine.rows[:1]), others, INDOOR)
    assert [row["entry"] for row in table.rows] == list(table.entries) == ["a", "a (b.json)"]
    assert table.entries["a (b.json)"]["settings"] == {"planner": "y"}
    assert table.origins[0] == "Left out of same.json, because the same entry is in the table: a."
    assert table.origins[1].endswith("planning times of that machine: a (b.json).")


def test_marks_of_the_terminal_in_results_are_shown_as_they_are():
    console = Console(width=200, file=StringIO())
    console.print(terminal_table(standings([row("a[/b]", failure="[/c]")], 1), "[/d]"))
    assert all(text in console.file.getvalue() for text in ("a[/b]", "1 [/c]", "[/d]"))


@pytest.mark.parametrize("protocol", [OUTDOOR, INDOOR, MOVING, BLIND], ids=lambda protocol: protocol.title)
def test_the_results_that_ship_are_of_this_version_and_name_how_they_were_made(protocol):
    results = shipped_results(protocol)
    hashes = {protocol.trial_hash(trial) for trial in protocol.trials}
    shipped = {row["entry"] for row in results.rows}
    assert shipped <= set(protocol.entries) and shipped
    assert {row["entry"] for row in results.rows if row["trial"] in hashes} == shipped
    assert results.head["entries"] == {name: described(protocol.entry(name)) for name in shipped}
    assert results.head["command"].startswith(f"mbf bench {protocol.name} --beside all") and results.head["commit"]


def test_all_shipped_entries_read_and_need_no_code_of_others():
    for protocol in (OUTDOOR, INDOOR, MOVING):
        for entry in protocol.entries.values():
            again = entrant(protocol, entry.settings, entry.backend, name="again")
            assert replace(again, name=entry.name) == entry


def test_what_cannot_be_judged_is_refused_before_anything_is_driven(tmp_path):
    for settings, options, expected in (
        ({"planner": "nothing"}, {}, r"planners\[0\].type: .*unknown type"),
        ({"planner": "cvp", "cvp.nonsense": "3"}, {"name": "mine"}, r"cvp.*nonsense"),
        ({"planner": "cvp"}, {"backend": "voxels"}, "--backend: expected one of mesh, costmap"),
        ({"planner": "cvp"}, {"name": "any_angle"}, "--name: expected a name of your own"),
        ({"planner": "re:Match", "allow_module_types": "false"}, {}, "switched off"),
    ):
        with pytest.raises(ConfigError, match=expected):
            entrant(OUTDOOR, settings, **options)
    with pytest.raises(ConfigError, match=r"--beside: expected one of any_angle, .* got 'nobody'"):
        OUTDOOR.entry("nobody")
    with pytest.raises(ConfigError, match=r"--surveys: expected a file kootenai_1m.npz"):
        outdoor([0], surveys=tmp_path)


PLUGIN = """import beside_it
from mbf_costmap_nav.planners.astar import AStarPlanner
class Mine(AStarPlanner):
    'Mine.'
"""


LAYER = """from mbf_costmap_nav.layers.static import StaticLayer
class Mine(StaticLayer):
    'Mine.'
"""


def test_code_and_files_that_change_make_another_entry(tmp_path, monkeypatch):
    """The module of a planner, one that it imports, the module of a layer, and a file that a setting names."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    layers = tmp_path / "layers_under_test"
    layers.mkdir()
    files = {
        tmp_path / "planner_under_test.py": PLUGIN,
        tmp_path / "beside_it.py": "",
        layers / "__init__.py": LAYER,
        tmp_path / "tree.yaml": "a: 1\n",
    }
    for file, text in files.items():
        file.write_text(text)
    settings = {
        "planner": "planner_under_test:Mine",
        "global_costmap.layers": "[{name: slopes, type: 'layers_under_test:Mine'}, {name: inflation, type: inflation}]",
        "global_costmap.slopes.map_file": "tree.yaml",
    }

    def key():
        mine = entrant(OUTDOOR, settings, "costmap")
        assert mine.name == "planner_under_test:Mine" and mine.backend == "costmap"
        return task_key(OUTDOOR, OUTDOOR.trials[0], mine)

    keys = [key(), key()]
    for file, text in files.items():
        file.write_text(text + "# changed\n")
        keys.append(key())
    assert len(set(keys)) == len(keys) - 1 == 5


def test_failures_have_classes():
    good = {"success": False, "time_s": 1.0, "incidents": [], "collisions_while_moving": 0, "plans": 1, "outcome": "X"}
    assert failure_of({"success": True}) == ""
    assert failure_of({"success": False}) == "error"
    assert failure_of(good) == "controller"
    assert failure_of(good | {"outcome": "NO_PATH_FOUND"}) == failure_of(good | {"plans": 0}) == "planner"
    assert failure_of(good | {"collisions_while_moving": 1}) == "contact"
    assert failure_of(good | {"incidents": ["tipped_over"]}) == "physics"


def test_a_lost_run_is_a_failure_with_its_reason_and_a_lost_judge_ends_the_evaluation():
    trial, entry = INDOOR.trials[0], INDOOR.entry("astar_pursuit")
    lost = lost_row(Task(trial, entry, INDOOR.judge), Lost("hung"))
    assert (lost["success"], lost["failure"], lost["message"], lost["level"]) == (False, "error", "hung", "failed")
    with pytest.raises(RuntimeError, match="the judge of level 0, seed 0: hung"):
        lost_row(Task(trial, None, INDOOR.judge), Lost("hung"))


def test_a_run_that_was_lost_is_done_again_by_the_next_command_and_others_are_not(tmp_path):
    trial, entry = INDOOR.trials[0], INDOOR.entry("astar_pursuit")
    protocol, bad = replace(INDOOR, trials=[trial]), replace(entry, settings={"planner": "no_such"})
    with SweepLog(tmp_path / "runs.jsonl") as log:
        log.append(task_key(protocol, trial, None), {"route": True})
        log.append(task_key(protocol, trial, bad), lost_row(Task(trial, bad, protocol.judge), Lost("crashed")))
        log.append(task_key(protocol, trial, entry), {"outcome": "SUCCESS"})

    driven = []
    for _ in range(2):
        first, second = run_trials(protocol, [bad, entry], tmp_path, 1, 600.0, driven.append)
        assert first["outcome"] == "ConfigError" and second["outcome"] == "SUCCESS"
    assert [row["outcome"] for row in driven] == ["ConfigError"]
