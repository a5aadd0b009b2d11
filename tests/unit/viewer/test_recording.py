"""What is recorded comes back from the file, and what is derived is right."""

import json
import math

import numpy as np
import pytest

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import AckermannCommand, Pose, Twist
from mbf_abstract.maps.served_map import ServedMap
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.view import GridView, MeshView
from terrain.physics.motion_sample import Thing
from terrain.physics.robot_models import CAR, HUSKY, TURTLEBOT
from terrain.recording.recorded_objects import AGE, IS_MOVING, NUMBER, VX, X, Y
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import MAP_PERIOD, MAX_GRID_CELLS, MAX_MESH_VERTICES, OBJECTS_PERIOD, Recorder
from terrain.recording.recording import Recording, RecordingError
from terrain.recording.run_folder import PARTS, RecordingParts, read_parts
from terrain.recording.verdict import Verdict
from terrain.scenarios.scenario import load_scenario
from terrain.session.session import Session, SessionOptions
from terrain.worlds.surface import cylinder


@pytest.mark.parametrize("name", ["hill_recording", "office_recording"])
def test_a_recording_comes_back_from_its_file_unchanged(name, request, tmp_path):
    recording = request.getfixturevalue(name)
    recording.save(tmp_path / "recording.npz")

    loaded = Recording.load(tmp_path / "recording.npz")

    for field in ("times", "poses", "twists", "commands"):
        np.testing.assert_array_equal(getattr(loaded, field), getattr(recording, field))
    for field in ("ground", "walls", "obstacles"):
        ours, theirs = getattr(recording, field), getattr(loaded, field)
        assert (ours is None) == (theirs is None)
        if ours is not None:
            np.testing.assert_array_equal(theirs.vertices, ours.vertices)
            np.testing.assert_array_equal(theirs.faces, ours.faces)
    for field in ("paths", "scans"):
        ours, theirs = getattr(recording, field), getattr(loaded, field)
        assert [stamp for stamp, _ in theirs] == [stamp for stamp, _ in ours]
        for (_, mine), (_, yours) in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(yours, mine)
    assert (loaded.start, loaded.goals, loaded.events) == (recording.start, recording.goals, recording.events)
    assert loaded.verdict == recording.verdict


def test_a_file_that_is_no_recording_is_refused_by_name(tmp_path):
    (tmp_path / "broken.npz").write_bytes(b"no archive")

    with pytest.raises(RecordingError, match=r"broken\.npz"):
        Recording.load(tmp_path / "broken.npz")


def test_an_empty_run_can_be_saved_and_has_no_duration(tmp_path):
    empty = Recorder("nothing", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), []).finish(Verdict(100, "no robot"))
    empty.save(tmp_path / "recording.npz")

    loaded = Recording.load(tmp_path / "recording.npz")

    assert loaded.duration == 0.0
    assert loaded.goals == () and loaded.paths == []


def test_tilt_is_the_angle_of_the_z_axis():
    recorder = Recorder("tilted", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), [])
    half = math.radians(30.0) / 2
    recorder.sample(0.0, Pose((0, 0, 0), (math.sin(half), 0, 0, math.cos(half))), Twist(), Twist())
    recorder.sample(0.1, Pose.planar(0, 0, yaw=2.0), Twist(), Twist())

    recording = recorder.finish(Verdict(0, ""))

    np.testing.assert_allclose(np.degrees(recording.tilt), [30.0, 0.0], atol=1e-9)


def test_the_command_of_a_car_is_recorded_as_its_speed():
    recorder = Recorder("car", "mesh", RobotShape.of(CAR), Pose.planar(0, 0), [])
    recorder.sample(0.0, Pose.planar(0, 0), Twist(), AckermannCommand(1.5, 0.2))

    assert recorder.finish(Verdict(0, "")).commands.tolist() == [[1.5, 0.0, 0.0]]


@pytest.mark.parametrize(("spec", "count", "rear"), [(HUSKY, 4, -0.256), (TURTLEBOT, 2, 0.0), (CAR, 4, 0.0)])
def test_wheels_stand_where_the_robot_has_them(spec, count, rear):
    wheels = RobotShape.of(spec).wheels

    assert wheels.shape == (count, 3)
    assert wheels[:, 0].min() == pytest.approx(rear)
    np.testing.assert_allclose(np.abs(wheels[:, 1]), spec.track / 2)
    np.testing.assert_allclose(wheels[:, 2], spec.wheel_radius)


def test_maps_are_recorded_every_few_seconds_and_come_back_from_the_file(tmp_path):
    recorder = Recorder("mapped", "costmap", RobotShape.of(HUSKY), Pose.planar(0, 0), [])
    views = [
        GridView(np.array([[0.0, np.nan], [0.5, value]], np.float32), (0.0, 1.0, 0.0, 1.0)) for value in (0.2, 9.0)
    ]
    for time, view in ((0.0, views[0]), (MAP_PERIOD - 0.1, views[1]), (MAP_PERIOD, views[1])):
        recorder.map(time, lambda view=view: view)
    recorder.finish(Verdict(0, "")).save(tmp_path / "recording.npz")

    grids = Recording.load(tmp_path / "recording.npz").grids

    assert [(grid.time, grid.extent) for grid in grids] == [(0.0, (0.0, 1.0, 0.0, 1.0)), (5.0, (0.0, 1.0, 0.0, 1.0))]
    np.testing.assert_allclose(grids[0].costs, views[0].costs, atol=0.005)
    np.testing.assert_array_equal(grids[1].cells, [[0, 255], [50, 100]])


def test_a_mesh_map_is_recorded_when_its_costs_have_changed_and_comes_back_from_the_file(tmp_path):
    recorder = Recorder("mapped", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), [])
    corners, faces = np.array([[0.0, 0.0, 0.1], [1.0, 0.0, 0.2], [0.0, 1.0, 0.3]]), np.array([[0, 1, 2]], np.int32)
    for turn, costs in enumerate(([0.0, 1.5, np.inf], [0.0, 1.5, np.inf], [0.0, 1e9, 2.0])):
        recorder.map(MAP_PERIOD * turn, lambda costs=costs: MeshView(corners, faces, np.array(costs, np.float32)))
    recorder.finish(Verdict(0, "")).save(tmp_path / "recording.npz")

    first, second = Recording.load(tmp_path / "recording.npz").meshes

    assert (first.time, second.time) == (0.0, 2 * MAP_PERIOD)
    np.testing.assert_array_equal(first.vertices, corners)
    np.testing.assert_array_equal(second.faces, faces)
    assert first.costs.tolist() == [0.0, 1.5, np.inf]
    assert np.isfinite(second.costs).all(), "what can be crossed at a high cost is not forbidden"


def test_only_maps_of_a_sensible_size_are_recorded():
    recorder = Recorder("mapped", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), [])
    cells = np.broadcast_to(np.float32(0.0), (MAX_GRID_CELLS + 1, 1))
    costs = np.broadcast_to(np.float32(0.0), MAX_MESH_VERTICES + 1)
    views = (
        None,
        GridView(cells, (0.0, 1.0, 0.0, 1.0)),
        MeshView(np.broadcast_to(0.0, (len(costs), 3)), np.zeros((1, 3), np.int32), costs),
    )

    for turn, view in enumerate(views):
        recorder.map(MAP_PERIOD * turn, lambda view=view: view)

    assert recorder.grids == [] and recorder.meshes == []


def test_a_run_without_end_does_not_record_maps_without_end():
    recorder = Recorder("mapped", "costmap", RobotShape.of(HUSKY), Pose.planar(0, 0), [], map_budget=10)
    view = GridView(np.zeros((2, 3), np.float32), (0.0, 1.0, 0.0, 1.0))

    for turn in range(9):
        recorder.map(MAP_PERIOD * turn, lambda: view)

    assert len(recorder.grids) == 2


class Pacer:
    """An actor that takes a step with every look at it."""

    thing = Thing.PERSON
    looks = cylinder(0.25, 1.7)

    def __init__(self) -> None:
        self.steps = 0

    def pose(self) -> Pose:
        self.steps += 1
        return Pose.planar(0.5 * self.steps, 2.0, z=0.85)


def test_what_moves_by_itself_is_recorded_with_every_sample_and_comes_back(tmp_path):
    recorder = Recorder("paced", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), [], actors=[Pacer()])
    for index in range(3):
        recorder.sample(0.1 * index, Pose.planar(0, 0), Twist(), Twist())
    recorder.finish(Verdict(0, "")).save(tmp_path / "recording.npz")

    (track,) = Recording.load(tmp_path / "recording.npz").actors

    assert track.thing == "person"
    np.testing.assert_array_equal(track.poses[:, :3], [[0.5, 2.0, 0.85], [1.0, 2.0, 0.85], [1.5, 2.0, 0.85]])
    np.testing.assert_array_equal(track.vertices, Pacer.looks[0])
    np.testing.assert_array_equal(track.faces, Pacer.looks[1])


def tracked(number, x, vx, motion=Motion.MOVING):
    return TrackedObject(number, motion, x, 2.0, 0.0, vx, 0.0, 0.25, 3.0, 0.0, 0.0, 0.0, "map")


def test_what_the_robot_knows_of_things_that_move_is_recorded_and_comes_back(tmp_path):
    recorder = Recorder("known", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), [])
    looks = [[], [tracked(7, 1.0, 0.5), tracked(9, 4.0, 0.0, Motion.PARKED)], [tracked(7, 1.1, 0.5)], [], []]
    for index, known in enumerate(looks):
        recorder.tracked(OBJECTS_PERIOD * index, lambda known=known: known)
    recorder.tracked(OBJECTS_PERIOD * index + 0.01, lambda: pytest.fail("looked again at once"))
    recorder.finish(Verdict(0, "")).save(tmp_path / "recording.npz")

    found = Recording.load(tmp_path / "recording.npz").objects

    assert [(round(one.time, 3), one.rows[:, NUMBER].tolist()) for one in found] == [
        (0.2, [7, 9]),
        (0.4, [7]),
        (0.6, []),
    ]
    np.testing.assert_array_equal(
        found[0].rows[:, [X, VX, AGE, IS_MOVING]], [[1.0, 0.5, 3.0, 1.0], [4.0, 0.0, 3.0, 0.0]]
    )


def test_a_session_records_what_its_map_tracks():
    types = {"obstacles": "obstacle", "moving": "moving_obstacles", "inflation": "inflation"}
    layers = json.dumps([{"name": name, "type": kind} for name, kind in types.items()])
    settings = {"local_costmap.layers": layers, "local_costmap.moving": "{sources: [lidar]}"}
    walks = load_scenario("crowded_corridor")
    with Session(walks.model_copy(update={"actors": walks.actors[:1]}), SessionOptions(settings=settings)) as session:
        session.clock.sleep(4.0)
        (person,), known = session.world.actors, session.recorder.objects

    assert np.diff([one.time for one in known]).min() >= OBJECTS_PERIOD - 1e-6
    row = known[-1].rows[0]
    assert math.dist(row[[X, Y]], (person.pose().x, person.pose().y)) < 0.4
    assert row[[VX, IS_MOVING]].tolist() == pytest.approx([person.velocity()[0], 1.0], abs=0.25)


@pytest.mark.parametrize(("scenario", "backend"), [("crowded_corridor", "costmap"), ("bridge", "mesh")])
def test_a_map_that_fails_to_say_what_moves_does_not_stop_the_physics(scenario, backend, monkeypatch):
    def raising(self):
        raise RuntimeError("no objects today")

    with Session(load_scenario(scenario), SessionOptions(backend=backend)) as session:
        monkeypatch.setattr(ServedMap, "tracked_objects", raising)
        began = session.simulation.time
        session.clock.sleep(1.0)
        assert session.simulation.time > began + 0.9
        assert session.recorder.objects == []
        fault = session.memory.of_kind(EventKind.FAULT)[0]
    assert (fault.data["type"], fault.data["message"]) == ("RuntimeError", "no objects today")


def test_parts_of_a_recording_have_their_own_objects():
    recorder = Recorder("known", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), [])
    recorder.tracked(0.0, lambda: [tracked(1, 1.0, 0.5)])
    assert len(recorder.take().objects) == 1
    recorder.tracked(1.0, lambda: [tracked(1, 1.5, 0.5)])
    assert [one.time for one in recorder.take().objects] == [1.0]


def test_the_joined_parts_of_a_run_have_the_objects_of_all(tmp_path):
    recorder = Recorder("street", "mesh", RobotShape.of(HUSKY), Pose.planar(0.0, 0.0), [])
    (tmp_path / PARTS).mkdir()
    for part in range(3):
        recorder.tracked(float(part), lambda: [tracked(1, 1.0, 0.5)])
        recorder.take().save(tmp_path / PARTS / f"{part:06d}.npz")

    assert [one.time for one in read_parts(tmp_path).objects] == [0.0, 1.0, 2.0]


def test_events_of_a_real_clock_are_brought_to_the_time_of_the_samples():
    recorder = Recorder("late", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), [])
    events = [Event(time, EventKind.CUSTOM, "test", {"number": number}) for number, time in enumerate((3.0, 4.5, 9.0))]

    recording = recorder.finish(Verdict(0, ""), events, began=4.25)

    assert [event.time for event in recording.events] == [0.0, 0.25, 4.75]
    assert [event.data["number"] for event in recording.events] == [0, 1, 2]


def test_parts_that_cannot_be_written_are_reported_once_and_the_run_goes_on(tmp_path):
    memory = MemorySink()
    events = EventBus(lambda: 0.0, [memory])
    parts = RecordingParts(tmp_path / "removed", None, events, (), lambda: 0.0)
    for time in (0.0, 3.0, 6.0):
        parts.after_step(time)
    parts.end()
    (failed,) = memory.of_kind(EventKind.SINK_FAILED)
    assert failed.data["sink"] == PARTS and "FileNotFoundError" in failed.data["message"]
