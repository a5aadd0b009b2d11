"""``mbf check`` lists all that is wrong with a scenario at once, and ``mbf run`` the same where it cannot begin."""

import re

import numpy as np
import pytest
import typer
from hypothesis import example, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from command_line import mbf
from mbf_abstract.commands.check import check as check_command
from mbf_abstract.config.yaml_source import load_yaml
from terrain.commands.check import check
from terrain.scenarios.library import LIBRARY, shipped_scenarios
from terrain.session.scenario_check import check_scenario

SCENARIO = {
    "name": "trial",
    "proves": "Nothing.",
    "backend": "mesh",
    "navigation": "{mesh: mesh.yaml, costmap: costmap.yaml}",
    "world": "{type: generated, size: [6.0, 5.0], spacing: 0.5}",
    "robot": "turtlebot",
    "start": "{x: 2.0, y: 2.5}",
    "goals": "[{x: 3.5, y: 2.5}]",
}
MESH = {
    "backend": "mesh",
    "planners": "[{name: dijkstra, type: dijkstra}]",
    "controllers": "[{name: follower, type: path_follower}]",
    "mesh_map": "{mesh_file: $WORLD_MESH, layers: []}",
}
COSTMAP = {
    "backend": "costmap",
    "planners": "[{name: dijkstra, type: dijkstra}]",
    "controllers": "[{name: pursuit, type: regulated_pure_pursuit}]",
    "global_costmap": "{robot_radius: 0.2, layers: [{name: walls, type: static}], walls: {map_file: $WORLD_MAP}}",
    "local_costmap": "{rolling_window: true, robot_radius: 0.2, layers: []}",
}
MISTAKES = {  # file, key with mistake, its value, key of the finding
    ("trial.yaml", "colour", "red", "colour"),
    ("trial.yaml", "time_limit", "long", "time_limit"),
    ("trial.yaml", "sensors", "[{rate: -1.0}]", "sensors[0].rate"),
    ("mesh.yaml", "dist_tolerance", "-1.0", "dist_tolerance"),
    ("mesh.yaml", "planners", "[{name: dijkstra, type: nosuch}]", "planners[0].type"),
    ("costmap.yaml", "inflation", "{}", "inflation"),
    (
        "costmap.yaml",
        "controllers",
        "[{name: pursuit, type: regulated_pure_pursuit, speed: 1.0}]",
        "controllers[0].speed",
    ),
}


def write(folder, mistakes=()):
    for name, keys in {"trial.yaml": SCENARIO, "mesh.yaml": MESH, "costmap.yaml": COSTMAP}.items():
        keys = keys | {key: value for file, key, value, _ in mistakes if file == name}
        (folder / name).write_text("".join(f"{key}: {value}\n" for key, value in keys.items()))
    return folder / "trial.yaml"


def found(report, folder):
    return {(finding.file.removeprefix(f"{folder}/"), finding.key) for finding in report.findings}


@settings(max_examples=6)
@example(mistakes=MISTAKES)
@given(mistakes=st.sets(st.sampled_from(sorted(MISTAKES))))
def test_every_mistake_is_found_whatever_else_is_wrong(mistakes, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenario")
    report = check_scenario(load_yaml(write(folder, mistakes)), load=False)

    assert found(report, folder) == {(file, key) for file, _, _, key in mistakes}
    assert len(report.findings) == len(mistakes)


@pytest.mark.parametrize("place", ["{x: 280.3, y: 2.5}", "{x: 1.0, y: -0.5}", "{x: 60.0, y: 2.5, z: 0.0}"])
def test_a_place_off_the_floor_plan_of_a_building_is_a_mistake(place, tmp_path):
    mistakes = [("trial.yaml", "world", "{type: office}", ""), ("trial.yaml", "start", place, "")]
    report = check_scenario(load_yaml(write(tmp_path, mistakes)))
    assert found(report, tmp_path) == {("trial.yaml", "start")}
    assert "a place on the ground of the world" in report.findings[0].text


def of_both(note):
    return [f"{costmap}: {note}" for costmap in ("global_costmap", "local_costmap")]


def test_a_start_and_a_goal_inside_a_wall_are_mistakes(tmp_path):
    wall, free = "{x: 0.15, y: 3.0}", "{x: 3.0, y: 3.0}"
    places = {"world": "{type: office}", "start": wall, "goals": f"[{free}, {wall}]"}
    mistakes = [("trial.yaml", key, value, "") for key, value in places.items()]
    report = check_scenario(load_yaml(write(tmp_path, mistakes)))
    assert found(report, tmp_path) == {("trial.yaml", "start"), ("trial.yaml", "goals[1]")}
    assert "expected a place outside the walls, got (0.15, 3)" in report.findings[0].text


@pytest.mark.parametrize(
    ("of_mesh", "of_costmaps", "notes"),
    [
        ("0.2", "robot_radius: 0.2", ["mesh_map: inscribed 0.20, 0.34", *of_both("inscribed 0.21, 0.34")]),
        ("0.34", "footprint: [[-0.5, -0.34], [0.5, -0.34], [0.5, 0.34], [-0.5, 0.34]]", []),
        ("0.34", "robot_radius: 0.36", of_both("circumscribed 0.37, 0.61")),
        ("0.0", "robot_radius: 0.7", []),
    ],
)
def test_a_footprint_that_does_not_hold_the_robot_is_noted(of_mesh, of_costmaps, notes, tmp_path):
    changes = [
        ("trial.yaml", "robot", "husky", ""),
        ("mesh.yaml", "mesh_map", f"{{mesh_file: $WORLD_MESH, layers: [], inscribed_radius: {of_mesh}}}", ""),
        *(
            ("costmap.yaml", key, COSTMAP[key].replace("robot_radius: 0.2", of_costmaps), "")
            for key in ("global_costmap", "local_costmap")
        ),
    ]
    report = check_scenario(load_yaml(write(tmp_path, changes)))

    assert not report.findings
    pattern = (
        r"(\w+): the footprint does not hold the robot 'husky': its (\w+) radius is (.*) m, that of the robot (.*) m"
    )
    said = [match.groups() for note in report.notes if (match := re.search(pattern, note))]
    assert [f"{name}: {radius} {own}, {of_robot}" for name, radius, own, of_robot in said] == notes


@pytest.mark.parametrize(
    ("world", "mistake"),
    [
        ("{type: moon}", r"world\.type: expected one of 'jacksboro', 'generated', .*, got 'moon'"),
        ("{}", r"world\.type: expected a value, got nothing"),
    ],
)
def test_a_world_of_an_unknown_type_is_named_with_the_types_there_are(world, mistake, tmp_path):
    report = check_scenario(load_yaml(write(tmp_path, [("trial.yaml", "world", world, "")])), load=False)
    assert re.search(mistake, report.findings[0].text)


@pytest.mark.parametrize(
    ("size", "expected"),
    [("[0.6, -0.8, 0.6]", "> 0 m"), ("[0.0, 0.5, 1.0]", "> 0 m"), ("[0.6, 1.0e+308, 0.6]", "<= 10000 m")],
)
def test_an_obstacle_of_no_extent_or_an_absurd_one_is_a_mistake(size, expected, tmp_path):
    obstacles = f"[{{x: 3.0, y: 2.5, size: {size}}}]"
    report = check_scenario(load_yaml(write(tmp_path, [("trial.yaml", "obstacles", obstacles, "")])), load=False)
    assert [key.startswith("obstacles[0].size") for _, key in found(report, tmp_path)] == [True]
    assert f"expected a number {expected}, got" in report.findings[0].text


@pytest.mark.parametrize(
    ("key", "value", "wrong"),
    [
        ("start", "{x: 1.0e+200, y: 2.5}", "start.x"),
        ("goals", "[{x: 3.0, y: 2.5, z: -1.0e+200}]", "goals[0].z"),
        ("obstacles", "[{x: 1.0e+200, y: 2.5}]", "obstacles[0].x"),
        ("actors", "[{type: walker, route: [[1.0e+200, 2.5]]}]", "actors[0].route[0][0]"),
        ("sensors", "[{type: planar, max_range: 1.0e+200}]", "sensors[0].max_range"),
        ("localization", "{position_noise: 1.0e+200}", "localization.position_noise"),
        ("perturb", "{pose_position: 1.0e+200}", "perturb.pose_position"),
        ("faults", "[{type: jump, start: 1.0, dx: 1.0e+200}]", "faults[0].dx"),
        ("world", "{type: generated, roughness: 1.0e+200}", "world.roughness"),
        ("world", "{type: map, file: a.yaml, corner: [1.0e+200, 0]}", "world.corner[0]"),
        ("world", "{type: generated, features: [{type: steps, x: 1.0e+200}]}", "world.features[0].x"),
    ],
)
def test_an_absurd_place_or_length_is_a_mistake_at_its_key(key, value, wrong, tmp_path):
    report = check_scenario(load_yaml(write(tmp_path, [("trial.yaml", key, value, "")])), load=False)
    (mistake,) = report.findings
    assert re.search(rf"{re.escape(wrong)}: expected a number .*, got -?1e\+200", mistake.text)


def test_places_maps_and_plugins_are_checked_in_the_world_together_with_the_rest(tmp_path):
    mistakes = [
        ("trial.yaml", "start", "{x: 60.0, y: 2.5}", ""),
        ("trial.yaml", "goals", "[{x: 3.5, y: 2.5}, hall]", ""),
        ("mesh.yaml", "dist_tolerance", "-1.0", ""),
        ("costmap.yaml", "global_costmap", "{layers: [{name: zones, type: keepout}], zones: {mask_file: no.yaml}}", ""),
    ]
    scenario = write(tmp_path, mistakes)

    report = check_scenario(load_yaml(scenario))

    expected = {
        ("trial.yaml", "start"),
        ("trial.yaml", "goals[1]"),
        ("mesh.yaml", "dist_tolerance"),
        ("costmap.yaml", "global_costmap.zones.mask_file"),
    }
    assert found(report, tmp_path) == expected
    text = "\n".join(finding.text for finding in report.findings)
    assert "'no.yaml'" in text and "mbf_check_" not in text, "files are named as their author knows them"
    result = mbf("check", scenario)
    assert result.exit_code == 2
    assert all(finding.text in result.output for finding in report.findings)
    assert "4 mistakes found" in result.output


def test_a_run_that_cannot_begin_prints_the_findings_of_its_backend(tmp_path):
    scenario = write(tmp_path, [("trial.yaml", "goals", "[hall, {x: 9.0, y: 9.0}]", ""), *sorted(MISTAKES)[-2:]])
    of_mesh = [finding for finding in check_scenario(load_yaml(scenario)).findings if "costmap" not in finding.file]

    result = mbf("run", scenario, "--out", tmp_path / "run", "--quiet")

    assert result.exit_code == 2
    assert len(of_mesh) >= 2 and f"{len(of_mesh)} mistakes found" in result.output
    assert all(finding.text in result.output for finding in of_mesh)


def test_settings_are_checked_with_the_scenario(tmp_path):
    options = ("--set", "world.size=[3.0, 3.0]", "--set", "planner_patience=soon")

    result = mbf("run", write(tmp_path), *options, "--out", tmp_path / "run", "--quiet")

    assert result.exit_code == 2 and "2 mistakes found" in result.output
    assert "goals[0]: expected a place on the ground of the world, got (3.5, 2.5)" in result.output
    assert "mesh.yaml (with settings)" in result.output and "planner_patience" in result.output


def test_a_world_that_cannot_be_built_is_a_finding_at_its_key(tmp_path):
    scenario = write(tmp_path, [("trial.yaml", "world", "{type: heightfield, file: no.tif}", "")])

    report = check_scenario(load_yaml(scenario))

    assert len(report.findings) == 1
    assert "no.tif" in report.findings[0].text


@pytest.mark.parametrize(
    ("ground", "reason"),
    [
        ("size: [1.0e+6, 12.0]", "expected at most 20000000 samples, got 4e+06 x 48"),
        ("size: [1.0e+308, 1.0e+308]", "expected at most 20000000 samples, got inf x inf"),
        ("size: [40.0, -3.0]", "expected lengths of more than 0 m, got 40 m x -3 m"),
    ],
)
def test_a_ground_of_too_many_samples_or_none_is_refused_before_it_is_drawn(ground, reason, tmp_path):
    scenario = write(tmp_path, [("trial.yaml", "world", f"{{type: generated, median_slope: 3.0, {ground}}}", "")])
    assert [reason in finding.text for finding in check_scenario(load_yaml(scenario)).findings] == [True]


@pytest.mark.parametrize(
    ("changes", "mistake"),
    [
        (
            {"world": "{type: generated, size: [6.0, 0.0]}"},
            "5: world.size: expected lengths of more than 0 m, got 6 m x 0",
        ),
        (
            {"world": "{type: heightfield, file: hill.npz, crop: [50.0, 60.0, 0.0, 1.0]}"},
            "5: world.crop: expected a part of x 0 to 4, y 0 to 4 [m] with 2 x 2 samples or more, got x 50 to 60",
        ),
        ({"world": "{type: heightfield, file: no.tif}"}, "5: world.file: expected an elevation model, got "),
        ({"world": "{type: mesh, file: no.ply}"}, "5: world.file: expected a mesh to drive on, got "),
        (
            {"world": "{type: generated, size: [400.0, 400.0], spacing: 0.25}"},
            "5: world: expected at most 2097152 samples for Bullet (crop it, or set a larger spacing), got 1601 x 1601",
        ),
        ({"obstacles": "[{x: 1.0, y: 1.0}, {x: 70.0, y: 1.0}]"}, "9: obstacles[1]: expected a place on the ground"),
        (
            {"world": "{type: office}", "obstacles": "[{x: 900.0, y: 2.5}]"},
            "9: obstacles[0]: expected a place on the ground of the world, got (900, 2.5)",
        ),
        (
            {"world": "{type: office}", "forests": "[{x_range: [90.0, 95.0], y_range: [1.0, 2.0]}]"},
            "9: forests[0]: expected a place on the ground of the world, got (92.5, 1.5)",
        ),
        (
            {"world": "{type: office}", "actors": "[{type: walker, route: [[1.0, 1.0], [1.0, 90.0]]}]"},
            "9: actors[0].route[1]: expected a place on the ground of the world, got (1, 90)",
        ),
        (
            {"obstacles": "[{x: 2.2, y: 2.6}]"},
            "7: start: expected a place outside the obstacles, got (2, 2.5), inside of",
        ),
        (
            {"forests": "[{x_range: [90.0, 95.0], y_range: [1.0, 2.0]}]"},
            "9: forests[0]: expected a place on the ground of the world, got (92.5, 1.5)",
        ),
        (
            {"forests": "[{x_range: [9.0, 2.0], y_range: [1.0, 2.0]}]"},
            "9: forests[0].x_range: expected two numbers, the smaller first, got 9, 2",
        ),
        (
            {"actors": "[{type: walker, route: [[1.0, 1.0], [1.0, 9.0]]}]"},
            "9: actors[0].route[1]: expected a place on the ground of the world, got (1, 9)",
        ),
        (
            {"actors": "[{type: walker, route: []}]"},
            "9: actors[0].route: expected a list of at least 1 items, got a list of 0 items",
        ),
        (
            {
                "actors": "[{type: crowd}]",
                "world": "{type: garage}",
                "start": "{x: 5.0, y: 5.0}",
                "goals": "[{x: 6, y: 5}]",
            },
            "9: actors[0]: expected no crowd in a world without a 2D map to draw its routes on, got 4 people",
        ),
        (
            {"actors": "[{type: crowd, x_range: [0.1, 0.2]}]", "world": "{type: office}"},
            "9: actors[0]: expected room to walk between the walls, got no route of 4 corners with 0.4 m to the walls",
        ),
        (
            {"world": "{type: generated, features: [{type: boulders, radius_min: 1.0, radius_max: 0.5}]}"},
            "5: world.features[0]: expected a radius_min of at most radius_max, got 1 and 0.5",
        ),
        (
            {"world": "{type: generated, features: [{type: ridge, points: [[1, 1]], height: 1.0, width: 1.0}]}"},
            "5: world.features[0].points: expected a list of at least 2 items, got a list of 1 items",
        ),
    ],
)
def test_what_contradicts_the_world_is_one_finding_at_its_key(changes, mistake, tmp_path):
    np.savez(tmp_path / "hill.npz", z=np.zeros((5, 5)), dx=1.0, dy=1.0)
    scenario = write(tmp_path, [("trial.yaml", key, value, "") for key, value in changes.items()])

    findings = check_scenario(load_yaml(scenario)).findings

    assert [finding.text.startswith(f"{scenario}:{mistake}") for finding in findings] == [True], findings


@pytest.mark.parametrize("name", shipped_scenarios())
def test_shipped_scenarios_have_no_mistakes(name):
    assert "backends" in check(LIBRARY / f"{name}.yaml", load=False).summary


def test_one_goal_is_counted_as_one_goal():
    assert check(LIBRARY / "outdoor.yaml", load=False).summary.endswith(", 1 goal")


def test_a_shipped_scenario_is_checked_by_its_name():
    result = mbf("check", "crowded_corridor", "--no-load")

    assert result.exit_code == 0 and "good; world office, backends costmap" in result.output
    assert "one of bridge, crater_rim" in mbf("check", "moon").output


@pytest.mark.parametrize("name", ["mesh.yaml", "costmap.yaml"])
def test_a_configuration_for_a_world_is_checked_on_level_ground(name, tmp_path):
    write(tmp_path)

    result = mbf("check", tmp_path / name)

    assert result.exit_code == 0, result.output
    assert "level ground stands in for the maps" in result.output


def test_its_mistakes_are_found_there(tmp_path):
    layers = "{mesh_file: $WORLD_MESH, layers: [{name: labels, type: label}], labels: {labels: nowhere}}"
    write(tmp_path, [("mesh.yaml", "mesh_map", layers, "")])

    result = mbf("check", tmp_path / "mesh.yaml")

    assert result.exit_code == 2 and "1 mistake found" in result.output
    assert str(tmp_path / "mesh.yaml") in result.output


def test_a_check_that_no_package_knows_is_that_of_a_configuration(tmp_path):
    (tmp_path / "empty.yaml").write_text("")
    app = typer.Typer()
    app.command()(check_command)

    result = CliRunner().invoke(app, [str(tmp_path / "empty.yaml")])

    assert result.exit_code == 2 and "an empty file" in result.output


@pytest.mark.parametrize("command", [["run", "--quiet", "--out", "run"], ["check"]], ids=["run", "check"])
@pytest.mark.parametrize("backend", ["mesh", "costmap"])
@pytest.mark.parametrize("physics", ["kinematic", "bullet"])
def test_robots_that_stand_in_each_other_are_named_with_file_and_line(tmp_path, monkeypatch, command, backend, physics):
    monkeypatch.chdir(tmp_path)
    robots = "[{name: anna, start: {x: 2.0, y: 2.0}, goals: [{x: 3.0, y: 2.0}]},\n"
    robots += "  {name: ben, start: {x: 2.1, y: 2.0}, goals: [{x: 3.0, y: 3.0}]}]"
    scenario = write(tmp_path, [("trial.yaml", "robots", robots, ""), ("trial.yaml", "physics", physics, "")])
    scenario.write_text(
        "".join(f"{line}\n" for line in scenario.read_text().splitlines() if line[:5] not in ("start", "goals"))
    )

    scenario.write_text(scenario.read_text().replace("backend: mesh", f"backend: {backend}"))

    result = mbf(*command, scenario)

    assert result.exit_code == 2 and "1 mistake found" in result.output
    assert f"{scenario}:8: robots[1].start: expected a place that 'anna' does not stand in" in result.output


def test_coordinates_of_a_survey_are_printed_whole_and_named_as_such(tmp_path):
    scenario = write(tmp_path, [("trial.yaml", "goals", "[{x: 556480.5, y: 5394960.0}]", "")])
    expected = "goals[0]: expected a place on the ground of the world, got (556480.5, 5394960) (metres from the corner"
    assert expected in mbf("check", scenario).output
