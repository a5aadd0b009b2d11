"""The kinematic stand-in drives scenarios on flat ground: same files, same sensors, same actors, no Bullet."""

import gc
import sys
import threading
import weakref

import pytest

from mbf_abstract.geometry import Twist
from terrain.scenarios.actors import Walker
from terrain.scenarios.scenario import PlanarPose, load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.session.session import Session, SessionOptions


@pytest.fixture
def corridor(monkeypatch):
    """The shipped corridor full of people, ten metres of it, without physics, on a machine that has none."""
    monkeypatch.setitem(sys.modules, "pybullet", None)
    scenario = load_scenario("crowded_corridor")
    return scenario.model_copy(update={"physics": "kinematic", "goals": (PlanarPose(x=11.0, y=9.7),)})


def test_the_crowded_corridor_is_driven_with_lidar_and_people_and_repeats(corridor, tmp_path):
    runs = [run_scenario(corridor, RunOptions(tmp_path / name)) for name in ("first", "second")]
    assert runs[0].success, runs[0].verdict
    assert runs[0].metrics["real_time_factor"] > 1.0
    logs = [(tmp_path / name / "events.jsonl").read_bytes() for name in ("first", "second")]
    assert logs[0] == logs[1]


def test_a_finished_run_leaves_no_thread_and_no_world_behind(corridor, tmp_path):
    before = threading.active_count()
    with Session(corridor, SessionOptions(tmp_path)) as session:
        session.clock.sleep(1.0)
        assert threading.active_count() > before
        world = weakref.ref(session.world)
    del session
    gc.collect()
    assert threading.active_count() == before
    assert world() is None


def test_a_person_in_the_way_is_seen_by_the_lidar_and_stops_the_robot(corridor, tmp_path):
    standing = Walker(type="walker", route=((4.0, 9.7), (4.0, 9.71)), speed=0.0)
    scenario = corridor.model_copy(update={"actors": (standing,), "start": PlanarPose(x=2.0, y=9.7)})
    with Session(scenario, SessionOptions(tmp_path)) as session:
        ends, hits = session.simulation.latest["lidar"].ends, session.simulation.latest["lidar"].hits
        ahead = ends[hits & (abs(ends[:, 1] - 9.7) < 0.1) & (ends[:, 0] > 2.0)]
        assert ahead[:, 0].min() == pytest.approx(3.75, abs=0.05)
        drive_ahead(session, 8.0)
        assert 3.2 < session.robot.pose().x < 3.75
        assert {incident.kind.value for incident in session.simulation.incidents} >= {
            "collision",
            "collision_with_person",
        }


def drive_ahead(session, seconds):
    end = session.clock.now() + seconds
    while session.clock.now() < end:
        session.robot.send_command(Twist.planar(0.4))
        session.clock.sleep(0.1)
