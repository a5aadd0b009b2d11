"""Scenario files: what is legal, and how mistakes are reported."""

import numpy as np
import pytest
from PIL import Image

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.reading import load_config
from terrain.scenarios.environment import build_environment
from terrain.scenarios.library import LIBRARY
from terrain.scenarios.noise import MapNoise
from terrain.scenarios.scenario import load_scenario
from terrain.scenarios.world import build_world
from terrain.scenarios.world_types import (
    BridgeWorld,
    GarageWorld,
    GeneratedWorld,
    HeightfieldWorld,
    MeshWorld,
    OfficeWorld,
)
from terrain.worlds.map_files import MapFiles

PLAIN = """
name: trial
proves: Nothing.
backend: mesh
navigation: {mesh: nav.yaml}
world: {type: generated, size: [12.0, 10.0], spacing: 0.5}
robot: husky
start: {x: 3.0, y: 3.0}
goals: [{x: 9.0, y: 7.0}]
"""
NO_PLACES = np.zeros((0, 2))


def scenario_file(folder, text):
    (folder / "nav.yaml").write_text("backend: mesh\n")
    file = folder / "trial.yaml"
    file.write_text(text)
    return file


def built(world, folder, seed=0, keep_clear=NO_PLACES):
    return build_world(
        world, MapFiles(folder, MapNoise(), np.random.default_rng(seed)), np.random.default_rng(seed), keep_clear
    )


def test_a_fault_of_an_unknown_sensor_is_refused_with_its_line(tmp_path):
    text = PLAIN + "faults:\n  - {type: silent, sensor: radar, start: 1.0}\n"
    with pytest.raises(ConfigError) as caught:
        load_scenario(scenario_file(tmp_path, text))
    (finding,) = caught.value.findings
    assert finding.line == text.splitlines().index("  - {type: silent, sensor: radar, start: 1.0}") + 1
    assert "localization" in finding.expected


def test_two_sensors_of_one_name_are_refused_as_only_the_last_would_be_there(tmp_path):
    text = PLAIN + "sensors:\n  - {type: planar, name: lidar}\n  - {type: rings, name: lidar}\n"
    with pytest.raises(ConfigError) as caught:
        load_scenario(scenario_file(tmp_path, text))
    assert "sensors[1].name: expected a name of its own, got 'lidar'" in str(caught.value)


@pytest.mark.parametrize("value", ["90", "-180.0"])
def test_headings_in_degrees_are_refused(tmp_path, value):
    with pytest.raises(ConfigError) as caught:
        load_scenario(scenario_file(tmp_path, PLAIN.replace("y: 3.0}", f"y: 3.0, yaw: {value}}}")))
    assert f"start.yaw: expected a number >= -6.2832 and <= 6.2832 rad, got {value}" in str(caught.value)


def test_a_list_with_too_many_numbers_is_refused_in_words(tmp_path):
    with pytest.raises(ConfigError) as caught:
        load_scenario(scenario_file(tmp_path, PLAIN.replace("[12.0, 10.0]", "[12.0, 10.0, 3.0]")))
    assert "world.size: expected a list of 2 items, got a list of 3 items" in str(caught.value)


def test_an_unknown_kind_of_world_is_refused(tmp_path):
    with pytest.raises(ConfigError):
        load_scenario(scenario_file(tmp_path, PLAIN.replace("type: generated", "type: moon")))


def test_files_of_a_world_count_from_the_folder_of_the_scenario(tmp_path):
    text = PLAIN.replace("{type: generated, size: [12.0, 10.0], spacing: 0.5}", "{type: mesh, file: hill.ply}")
    assert load_scenario(scenario_file(tmp_path, text)).world.file == tmp_path / "hill.ply"


def test_the_name_of_a_place_stands_for_its_pose(tmp_path):
    world = built(OfficeWorld(type="office"), tmp_path)
    assert world.pose_of("kitchen").position == (4.2, 13.0, 0.0)
    with pytest.raises(ConfigError, match="kitchen"):
        world.pose_of("cellar")
    world.physics.close()


def test_each_seed_draws_its_own_ground_and_the_same_one_again(tmp_path):
    world = GeneratedWorld(type="generated", size=(12.0, 10.0), spacing=0.5, median_slope=5.0)
    heights = [world.heightfield(np.random.default_rng(seed), NO_PLACES).heights for seed in (1, 1, 2)]
    assert np.array_equal(heights[0], heights[1])
    assert not np.array_equal(heights[0], heights[2])


def test_features_are_put_on_the_ground_in_order(tmp_path):
    crater = {"type": "crater", "x": 6.0, "y": 5.0, "radius": 3.0, "depth": 1.0}
    steps = {"type": "steps", "x": 9.0, "height": 0.5, "count": 1}
    world = GeneratedWorld(type="generated", size=(12.0, 10.0), spacing=0.5, features=(crater, steps))
    terrain = world.heightfield(np.random.default_rng(0), NO_PLACES)
    assert terrain.height_at(6.0, 5.0) == pytest.approx(-1.0)
    assert terrain.height_at(11.0, 5.0) > 0.45


def test_boulders_leave_start_and_goal_clear():
    boulders = {"type": "boulders", "density": 50.0, "radius_min": 0.5, "radius_max": 1.0}
    world = GeneratedWorld(type="generated", size=(12.0, 10.0), spacing=0.25, features=(boulders,))
    terrain = world.heightfield(np.random.default_rng(0), np.array([[3.0, 3.0]]))
    assert terrain.height_at(3.0, 3.0) == 0.0
    assert terrain.heights.max() > 0.4


def test_a_world_of_levels_has_places_above_each_other_and_no_flat_map(tmp_path):
    for model, low, high in (
        (GarageWorld(type="garage", floors=2), "entrance", "roof"),
        (BridgeWorld(type="bridge"), "road", "deck"),
    ):
        world = built(model, tmp_path)
        assert world.pose_of(low).position[:2] == world.pose_of(high).position[:2]
        assert world.pose_of(high).z > world.pose_of(low).z + 2.0
        assert set(world.files) == {"$WORLD_MESH"}
        world.physics.close()


def test_a_mesh_file_and_an_elevation_file_become_worlds(tmp_path):
    garage = built(GarageWorld(type="garage", floors=2), tmp_path)
    again = built(MeshWorld(type="mesh", file=garage.files["$WORLD_MESH"]), tmp_path)
    assert len(again.ground.faces) == len(garage.ground.faces)
    assert again.height_at(3.0, 12.0) == pytest.approx(garage.pose_of("roof").z)
    (tmp_path / "hill.asc").write_text("ncols 3\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 10\n0 0 0\n0 6 0\n0 0 0\n")
    hill = built(HeightfieldWorld(type="heightfield", file=tmp_path / "hill.asc", size=10.0), tmp_path)
    assert hill.ground.vertices[:, 2].max() == pytest.approx(3.0)
    for world in (garage, again, hill):
        world.physics.close()


def test_a_forest_is_the_same_for_the_same_seed_and_leaves_room(tmp_path):
    text = PLAIN + "forests: [{x_range: [0.5, 11.5], y_range: [0.5, 9.5], count: 12, gap: 1.5}]\n"
    scenario = load_scenario(scenario_file(tmp_path, text))
    surfaces = []
    for seed in (1, 1, 2):
        world, posts = build_environment(scenario, tmp_path, seed)
        world.physics.close()
        surfaces.append(posts.vertices)
    assert np.array_equal(surfaces[0], surfaces[1])
    assert surfaces[0].shape != surfaces[2].shape or not np.array_equal(surfaces[0], surfaces[2])
    from_start = np.linalg.norm(surfaces[0][:, :2] - (3.0, 3.0), axis=1)
    assert from_start.min() > 1.5 - 0.15 - 1e-9


def test_the_2d_map_of_a_terrain_has_every_shade_of_slope_up_to_the_lethal_one(tmp_path):
    hill = {"type": "ridge", "points": ((6.0, -5.0), (6.0, 15.0)), "height": 2.0, "width": 12.0}
    shades = {}
    for lethal_slope in (20.0, 60.0):
        world = GeneratedWorld(
            type="generated", size=(12.0, 10.0), spacing=0.5, features=(hill,), lethal_slope=lethal_slope
        )
        with built(world, tmp_path).physics:
            shades[lethal_slope] = np.asarray(Image.open(tmp_path / "world.png"))[5:-5, 5:-5]
    assert shades[20.0].max() == 100 and shades[60.0].max() < 100
    assert len(np.unique(shades[60.0])) > 3


def test_the_steps_of_the_physics_are_as_long_as_the_scenario_says(tmp_path):
    text = PLAIN + "physics_rate: 120.0\n"
    world, _ = build_environment(load_scenario(scenario_file(tmp_path, text)), tmp_path, 0)
    with world.physics:
        assert world.physics.time_step == pytest.approx(1.0 / 120.0)


def test_several_levels_without_physics_are_refused(tmp_path):
    text = PLAIN.replace("{type: generated, size: [12.0, 10.0], spacing: 0.5}", "{type: bridge}")
    with pytest.raises(ConfigError, match="several levels"):
        load_scenario(scenario_file(tmp_path, text + "physics: kinematic\n"))


def test_a_configuration_in_place_of_a_scenario_and_the_other_way_round_is_one_mistake(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text("backend: costmap\nplanners: [{name: astar, type: astar}]\nglobal_costmap: {}\n")

    with pytest.raises(ConfigError) as no_scenario:
        load_scenario(file)
    with pytest.raises(ConfigError) as no_configuration:
        load_config(LIBRARY / "indoor.yaml")

    assert [one.text for one in no_scenario.value.findings] == [
        f"{file}:1: expected a scenario, got a configuration (a scenario has a world, a robot and goals, "
        "and names its configurations under navigation)"
    ]
    assert [one.text for one in no_configuration.value.findings] == [
        f"{LIBRARY / 'indoor.yaml'}:1: expected a configuration, got a scenario (mbf run drives it; "
        "its configurations are those that its key navigation names)"
    ]
