"""The environment keeps Gymnasium's contract, and its episodes end as a run would be judged."""

import warnings

import numpy as np
import pytest

from mbf_abstract.config.findings import ConfigError
from terrain.experiments.evaluation.outdoor import CONFIGS as OUTDOOR
from terrain.learning.worlds import bench_indoor, bench_moving, bench_outdoor
from terrain.recording.metrics import measure
from terrain.scenarios.faults import SensorFault
from terrain.scenarios.limits import Limits
from terrain.scenarios.scenario import PlanarPose
from terrain.scenarios.world_types import GeneratedWorld

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra gym")


def as_bytes(first, steps):
    observations = [first, *(step[0] for step in steps)]
    return b"".join(part.tobytes() for seen in observations for part in seen.values()), [s[1] for s in steps]


def test_gymnasiums_own_check_passes(make_environment):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make_environment(), skip_render_check=True)


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_a_policy_that_follows_the_plan_arrives_and_the_judge_calls_it_a_success(
    make_environment, drive, to_the_waypoint, backend
):
    first, steps = drive(make_environment(backend=backend), to_the_waypoint, seed=3)
    *_, (_, _, terminated, truncated, info) = steps
    assert (terminated, truncated, info["ending"], info["success"]) == (True, False, "arrived", True)
    assert info["verdict"].startswith("SUCCESS")
    assert first["goal"][0] == pytest.approx(2.0, abs=0.1)


def test_the_parts_of_the_reward_add_up_and_progress_is_the_way_that_was_made(make_environment, drive, to_the_waypoint):
    _, steps = drive(make_environment(reward={"tilt": 1.0}), to_the_waypoint, seed=3)
    for _, reward, *_, info in steps:
        assert reward == pytest.approx(sum(info["reward_parts"].values()))
    progress = sum(step[4]["reward_parts"]["progress"] for step in steps)
    assert 1.6 < progress < 2.0  # 2 m less the tolerance of the goal
    assert steps[-1][4]["reward_parts"]["arrival"] == 10.0
    assert all(step[4]["reward_parts"]["arrival"] == 0.0 for step in steps[:-1])


def test_a_robot_that_backs_into_a_wall_ends_with_a_contact_that_costs(make_environment, drive):
    _, steps = drive(make_environment(), lambda seen: [-1.0, 0.0], seed=3)
    info = steps[-1][4]
    assert (info["ending"], info["success"], steps[-1][2]) == ("contact", False, True)
    assert "contacts while the robot moved" in info["verdict"]
    assert info["reward_parts"]["contact"] == -10.0
    assert sum(step[4]["reward_parts"]["progress"] for step in steps) < 0.0


def test_a_robot_that_stands_is_cut_off_by_time_and_a_broken_limit_ends_an_episode(
    make_environment, drive, small_room, to_the_waypoint
):
    _, steps = drive(make_environment(time_limit=1.0), lambda seen: [0.0, 0.0])
    assert steps[-1][2:4] == (False, True) and steps[-1][4]["ending"] == "time"
    strict = small_room(limits=Limits(max_path_length=0.5))
    _, steps = drive(make_environment(strict), to_the_waypoint)
    assert steps[-1][4]["ending"] == "limit" and not steps[-1][4]["success"]


def test_several_goals_are_visited_one_after_the_other(make_environment, drive, small_room, to_the_waypoint):
    goals = (PlanarPose(x=3.0, y=2.5, yaw=0.0), PlanarPose(x=4.0, y=2.5, yaw=0.0))
    _, steps = drive(make_environment(small_room(goals=goals)), to_the_waypoint)
    assert steps[-1][4]["success"]
    ahead = [float(step[0]["goal"][0]) for step in steps]
    assert max(np.diff(ahead)) == pytest.approx(1.0, abs=0.1)  # the next goal comes into view
    assert sum(step[4]["reward_parts"]["arrival"] for step in steps) == 10.0


def test_the_same_seeds_and_actions_give_the_same_bytes_also_in_episodes_without_a_seed(
    make_environment, drive, small_room
):
    noisy = small_room(localization=small_room().localization.widened(0.02, 1.0), time_limit=2.0)

    def record(environment):
        rng = np.random.default_rng(0)

        def policy(seen):
            return rng.uniform(-1.0, 1.0, 2)

        return [as_bytes(*drive(environment, policy, seed=seed)) for seed in (5, None, None)]

    one, other = record(make_environment(noisy)), record(make_environment(noisy))
    assert one == other
    assert len({bytes_of for bytes_of, _ in one}) == 3


def test_vectorised_environments_drive_as_single_ones(make_environment):
    import terrain.learning.ids  # noqa: F401 - registers them

    arguments = {"levels": [0], "observation": {"scan_sectors": 12, "waypoints": 3}, "commands": {"max_vel_x": 0.5}}
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (4, 2, 2)).astype(np.float32)
    seen = {}
    for mode in ("sync", "async"):
        vector = gymnasium.make_vec("mbf/bench_indoor-v1", num_envs=2, vectorization_mode=mode, **arguments)
        observations = [vector.reset(seed=20)[0]] + [vector.step(action)[0] for action in actions]
        seen[mode] = [{name: part.copy() for name, part in one.items()} for one in observations]
        vector.close()
    for number in range(2):
        single = gymnasium.make("mbf/bench_indoor-v1", **arguments)
        observations = [single.reset(seed=20 + number)[0]] + [single.step(action[number])[0] for action in actions]
        single.close()
        for mode in seen:
            for alone, together in zip(observations, seen[mode], strict=True):
                assert all(np.array_equal(alone[name], together[name][number]) for name in alone)


@pytest.mark.parametrize("people", ["yielding", "blind"])
def test_the_moving_evaluation_is_an_environment_in_whose_scans_people_walk(people):
    import terrain.learning.ids  # noqa: F401 - registers them

    environment = gymnasium.make("mbf/bench_moving-v1", levels=[9], people=people)
    first, info = environment.reset(seed=3)
    scans = [first["scan"], *(environment.step([0.0, 0.0])[0]["scan"] for _ in range(10))]
    environment.close()

    assert info["world_seed"] == 3 and environment.action_space.shape == (2,)
    assert np.ptp(np.stack(scans), axis=0).max() > 0.2, "the robot stands, people walk by 0.7 m"


def test_people_that_there_are_not_are_refused():
    with pytest.raises(ValueError, match="people: expected one of yielding, blind, got 'angry'"):
        bench_moving(people="angry")


def test_every_shipped_scenario_with_one_robot_has_an_id():
    from terrain.learning import ids
    from terrain.scenarios.library import shipped_scenarios
    from terrain.scenarios.scenario import load_scenario

    single = {name for name in shipped_scenarios() if not load_scenario(name).robots}
    assert single == shipped_scenarios().keys() - ids.SEVERAL_ROBOTS
    assert {f"mbf/{name}-v0" for name in single} <= gymnasium.registry.keys()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"control_period": 0.0}, "control_period: expected a time above 0 s, got 0.0"),
        ({"time_limit": 0.0}, "time_limit: expected a time above 0 s, got 0.0"),
        ({"time_limit": float("nan")}, "time_limit: expected a time above 0 s, got nan"),
        ({"seeds": (5, 5)}, "seeds: expected a first one from 0 on, and a later one"),
        ({"seeds": 5}, "seeds: expected a first one from 0 on, and a later one, got 5"),
        ({"observation": {"scan_sector": 3}}, "^scan_sector: expected a known key, got 'scan_sector'"),
        ({"commands": {"max_vel_x": -1.0}}, "^max_vel_x: expected a number > 0 and <= 20 m/s, got -1.0"),
    ],
)
def test_a_wrong_argument_is_refused_at_once(make_environment, arguments, message):
    with pytest.raises(ValueError, match=message):
        make_environment(**arguments)


@pytest.mark.parametrize(
    ("changes", "arguments", "message"),
    [
        ({"sensors": ()}, {}, "scan_sectors: expected 0 in 'small room', which has no lidar"),
        (
            {},
            {"observation": {"patch_cells": 3}},
            "patch_cells: expected 0 on a map without heights",
        ),
        ({}, {"control_period": 5.0}, "control_period: expected at most the command_timeout of the configuration"),
    ],
)
def test_what_a_scenario_cannot_give_is_refused_when_its_world_is_built(
    make_environment, small_room, changes, arguments, message
):
    with pytest.raises(ValueError, match=message):
        make_environment(small_room(**changes), **arguments).reset(seed=0)


@pytest.mark.parametrize("sensor", ["lidar", "localization"])
def test_a_sensor_that_falls_silent_leaves_its_last_value_and_the_episode_goes_on(
    make_environment, drive, small_room, sensor
):
    silent = SensorFault(type="silent", sensor=sensor, start=1.0)
    environment = make_environment(small_room(faults=(silent,), time_limit=5.5))
    _, steps = drive(environment, lambda seen: [0.2, 0.0], seed=3)
    part = {"lidar": "scan", "localization": "goal"}[sensor]
    assert steps[-1][4]["ending"] == "time"
    if sensor == "localization":
        assert np.array_equal(steps[10][0][part], steps[-1][0][part])
    else:  # the points stay where they are, the robot passes them
        assert steps[-1][0][part][0] == pytest.approx(steps[10][0][part][0] + 0.4, abs=0.1)


def test_hills_in_bullet_are_driven_on_with_heights_and_without_a_lidar(make_environment, small_room):
    ground = GeneratedWorld(type="generated", size=(8.0, 8.0), spacing=0.25, median_slope=6.0)
    at = {"start": PlanarPose(x=2.0, y=2.0, yaw=0.0), "goals": (PlanarPose(x=6.0, y=6.0, yaw=0.0),)}
    hills = small_room(
        physics="bullet",
        world=ground,
        robot="husky",
        backend="mesh",
        navigation=OUTDOOR,
        sensors=(),
        obstacles=(),
        **at,
    )
    environment = make_environment(hills, observation={"scan_sectors": 0, "waypoints": 2, "patch_cells": 5})
    observation, _ = environment.reset(seed=0)
    assert np.ptp(observation["patch"]) > 0.05
    gained = 0.0
    for _ in range(10):
        observation, _, terminated, truncated, info = environment.step([0.5, 0.0])
        gained += info["reward_parts"]["progress"]
        assert not terminated and not truncated
    assert gained > 0.1 and environment.observation_space.contains(observation)


def test_the_judge_gets_the_numbers_of_the_recording_of_a_run(make_environment, small_room):
    hills = small_room(
        world=GeneratedWorld(type="generated", size=(7.0, 5.0), spacing=0.25, median_slope=6.0), obstacles=()
    )
    environment = make_environment(hills, backend="mesh")
    environment.reset(seed=0)
    for turn in (0.0, 0.6, 0.6, -0.6, 0.0, -0.6, 0.4):
        environment.step([1.0, turn])
    judged = environment._episode._metrics()
    recorded = measure(environment._episode.session.recorder.finish()).to_json()
    assert judged["max_tilt_deg"] > 0.5 and judged["path_length_m"] > 0.1
    for name in ("max_tilt_deg", "path_length_m"):
        assert judged[name] == pytest.approx(recorded[name], abs=2e-6)


def test_a_seed_that_is_given_is_counted_into_the_seeds(make_environment):
    environment = make_environment(seeds=(1000, 3000))
    worlds = [environment.reset(seed=seed)[1]["world_seed"] for seed in (0, 1000, 2999, 3001)]
    assert worlds == [1000, 1000, 2999, 2001]


def test_what_an_action_is_beyond_its_range_costs_no_effort(make_environment):
    environment = make_environment()
    environment.reset(seed=0)
    environment.step([1.0, 0.0])
    assert environment.step([5.0, 0.0])[4]["reward_parts"]["effort"] == 0.0


def test_a_simulation_that_fails_ends_the_episode(make_environment):
    environment = make_environment()
    environment.reset(seed=0)

    def fail(time):
        raise OSError("no physics")

    environment._episode.session.loop.on_tick.append(fail)
    with pytest.raises(OSError, match="no physics"):
        environment.step([0.0, 0.0])
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.step([0.0, 0.0])
    environment.reset(seed=0)


@pytest.mark.parametrize("levels", [[], [12], [-1], ["a"], [2.5]])
def test_levels_that_an_evaluation_does_not_have_are_refused(levels):
    for worlds in (bench_indoor, bench_outdoor):
        with pytest.raises(ValueError, match="levels: expected at least one from 0 to 9"):
            worlds(levels)


def test_misuse_is_refused(make_environment):
    environment = make_environment()
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.step([0.0, 0.0])
    environment.reset(seed=0)
    with pytest.raises(ValueError, match="action: expected 2 finite numbers from -1 to 1, got"):
        environment.step([np.nan, 0.0])
    with pytest.raises(ConfigError, match="no_such_scenario"):
        make_environment("no_such_scenario")
    with pytest.raises(ConfigError, match="one robot, for an environment"):
        make_environment("two_couriers")
