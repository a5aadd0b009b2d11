"""run.mcap, read back with the MCAP library's own reader: schemas, order of time, and the numbers of the recording."""

import json
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from mcap.decoder import DecoderFactory
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoderFactory

from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.view import GridView, MeshView
from terrain.physics.robot_models import HUSKY
from terrain.recording.actor_track import ActorTrack
from terrain.recording.recorded_objects import RecordedObjects
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import MAP_PERIOD, Recorder
from terrain.recording.recording import Recording
from terrain.recording.verdict import Verdict
from terrain.session.session import Session
from terrain.viewer.logs.event_messages import ActionStates
from terrain.viewer.logs.foxglove_messages import MAP_LIFT, nanoseconds, triangles
from terrain.viewer.logs.mcap_log import write_mcap
from terrain.viewer.pictures.colours import WALL

SCHEMAS = {
    "/tf": "foxglove.FrameTransforms",
    "/scene": "foxglove.SceneUpdate",
    "/plan": "foxglove.PosesInFrame",
    "/goals": "foxglove.PosesInFrame",
    "/scan": "foxglove.PointCloud",
    "/map": "foxglove.Grid",
    "/log": "foxglove.Log",
    "/events": "mbf.Event",
    "/actions": "mbf.ActionStates",
    "/motion": "mbf.Motion",
}


class JsonDecoderFactory(DecoderFactory):
    def decoder_for(self, message_encoding, schema):
        return json.loads if message_encoding == "json" and schema.encoding == "jsonschema" else None


class Log:
    """Every message of a file, decoded from the schemas in the file alone."""

    def __init__(self, file):
        self.schemas, self.times, self.messages = {}, [], defaultdict(list)
        with file.open("rb") as stream:
            reader = make_reader(
                stream, validate_crcs=True, decoder_factories=[ProtobufDecoderFactory(), JsonDecoderFactory()]
            )
            self.metadata = {record.name: record.metadata for record in reader.iter_metadata()}
            self.count = reader.get_summary().statistics.message_count
            for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
                self.schemas[channel.topic] = schema.name
                self.times.append(message.log_time)
                self.messages[channel.topic].append((message.log_time, decoded))

    def __getitem__(self, topic):
        return [decoded for _, decoded in self.messages[topic]]


@pytest.fixture
def office(office_recording):
    view = GridView(np.array([[0.0, 0.5, 1.0], [np.nan, np.inf, 0.25]], np.float32), (1.0, 2.5, -1.0, 0.0))
    recorder = Recorder("", "", office_recording.robot, office_recording.start, [])
    recorder.map(0.4, lambda: view)
    office_recording.grids.extend(recorder.grids)
    return office_recording


@pytest.fixture
def log(office, tmp_path):
    write_mcap(tmp_path / "run.mcap", office)
    return Log(tmp_path / "run.mcap")


def test_every_topic_has_its_schema_and_every_message_can_be_decoded(log):
    assert log.schemas == SCHEMAS
    assert sum(len(messages) for messages in log.messages.values()) == log.count


def test_messages_come_in_the_order_of_time(log):
    assert log.times == sorted(log.times)


def test_the_transforms_are_the_recorded_track(log, office):
    stamps = [stamp for stamp, _ in log.messages["/tf"]]
    bodies = [message.transforms[0] for message in log["/tf"]]
    rows = [
        [b.translation.x, b.translation.y, b.translation.z, b.rotation.x, b.rotation.y, b.rotation.z, b.rotation.w]
        for b in bodies
    ]

    assert stamps == [nanoseconds(time) for time in office.times]
    assert {(b.parent_frame_id, b.child_frame_id) for b in bodies} == {("map", "base_link")}
    np.testing.assert_array_equal(rows, office.poses)


def test_every_frame_that_is_drawn_in_has_a_transform(log):
    known = {"map"} | {transform.child_frame_id for message in log["/tf"] for transform in message.transforms}
    drawn = {entity.frame_id for message in log["/scene"] for entity in message.entities}

    assert drawn == known == {"map", "base_link", "wheel_0", "wheel_1"}


def test_the_scene_holds_the_world_the_robot_and_the_track(log, office):
    entities = {entity.id: entity for message in log["/scene"] for entity in message.entities}
    track = [entity.lines[0].points for name, entity in entities.items() if name.startswith("track")]

    assert {"walls", "obstacles", "ground", "start", "goal", "body", "wheel 0", "wheel 1"} <= set(entities)
    assert len(entities["walls"].triangles[0].indices) == office.walls.faces.size
    assert (track[0][0].x, track[0][0].y) == tuple(office.poses[0, :2].round(6))
    assert (track[-1][-1].x, track[-1][-1].y) == tuple(office.poses[-1, :2].round(6))


def test_plans_look_along_themselves(log):
    poses = log["/plan"][0].poses
    yaws = [2.0 * np.arctan2(pose.orientation.z, pose.orientation.w) for pose in poses]

    assert [(pose.position.x, pose.position.y) for pose in poses] == [(2, 3), (8, 6), (14, 9)]
    np.testing.assert_allclose(yaws, np.arctan2(3, 6))


def test_scans_and_maps_are_unpacked_to_what_was_recorded(log, office):
    clouds = [np.frombuffer(message.data, "<f4").reshape(-1, 3) for message in log["/scan"]]
    grid = log["/map"][0]
    cells = np.frombuffer(grid.data, np.uint8).reshape(-1, grid.column_count, grid.cell_stride)

    assert len(clouds) == len(office.scans)
    np.testing.assert_allclose(clouds[3], office.scans[3][1], atol=1e-6)
    assert [field.name for field in grid.fields] == ["red", "green", "blue", "alpha", "cost"]
    np.testing.assert_array_equal(cells[..., 4], [[0, 50, 100], [255, 100, 25]])
    assert (grid.pose.position.x, grid.pose.position.y) == (1.0, -1.0)
    assert (grid.cell_size.x, grid.cell_size.y) == (0.5, 0.5)


@pytest.fixture
def hill_with_costs(hill_recording):
    """Costs of a hill that grow with x, forbidden on its eastern edge; then a heap in the way that goes again."""
    ground = hill_recording.ground
    x = ground.vertices[:, 0]
    bare = np.where(x > 38.0, np.inf, 0.1 * x).astype(np.float32)
    heap = np.linalg.norm(ground.vertices[:, :2] - (20.0, 15.0), axis=1) < 1.0
    recorder = Recorder("", "", hill_recording.robot, hill_recording.start, [])
    for turn, costs in enumerate((bare, np.where(heap, np.inf, bare), bare)):
        recorder.map(MAP_PERIOD * turn, lambda costs=costs: MeshView(ground.vertices, ground.faces, costs))
    return replace(hill_recording, meshes=recorder.meshes)


def test_a_mesh_map_is_drawn_in_the_colours_of_its_costs_and_what_changes_is_drawn_over_it(hill_with_costs, tmp_path):
    write_mcap(tmp_path / "run.mcap", hill_with_costs)

    log, ground = Log(tmp_path / "run.mcap"), hill_with_costs.ground
    whole, heap, gone = log["/mesh_map"]
    surface, over = whole.entities[0].triangles[0], heap.entities[0].triangles[0]
    colours = np.array([(c.r, c.g, c.b) for c in surface.colors])

    assert log.schemas == {topic: schema for topic, schema in SCHEMAS.items() if topic not in ("/scan", "/map")} | {
        "/mesh_map": "foxglove.SceneUpdate"
    }
    np.testing.assert_allclose([(p.x, p.y, p.z - MAP_LIFT) for p in surface.points], ground.vertices, atol=1e-6)
    assert len(surface.indices) == ground.faces.size
    forbidden = ground.vertices[:, 0] > 38.0
    np.testing.assert_allclose(colours[forbidden], np.tile(np.array(WALL) / 255.0, (forbidden.sum(), 1)), atol=1e-3)
    lightness = colours @ [0.2126, 0.7152, 0.0722]
    order = np.argsort(ground.vertices[~forbidden, 0], kind="stable")
    assert (np.diff(lightness[~forbidden][order]) < 0.01).all(), "costly ground is darker"
    assert {pair.key: pair.value for pair in whole.entities[0].metadata} == {"highest_cost": "3.801"}
    assert 0 < len(over.indices) < 0.01 * len(surface.indices)
    assert max(np.hypot(p.x - 20.0, p.y - 15.0) for p in over.points) < 2.0
    assert [(d.id, d.type) for d in gone.deletions] == [("changed costs", 0)] and heap.entities[0].id == "changed costs"


def test_a_mesh_is_the_message_that_is_put_together_point_by_point():
    rng = np.random.default_rng(3)
    vertices = np.concatenate([np.round(rng.normal(0.0, 50.0, (40, 3)), 8), [[0.0, -0.0, 1e-9], [-1e-9, 1e5, 0.0]]])
    colours = np.concatenate([rng.integers(0, 256, (40, 3)), [[0, 0, 0], [255, 0, 1]]]).astype(np.uint8)
    faces = rng.integers(0, 42, (30, 3)).astype(np.int32)
    expected = TriangleListPrimitive(indices=faces.ravel().tolist())
    expected.pose.orientation.w = 1.0
    for (x, y, z), (r, g, b) in zip(np.round(vertices, 6).tolist(), (colours / 255.0).round(3).tolist(), strict=True):
        expected.points.add(x=x, y=y, z=z)
        expected.colors.add(r=r, g=g, b=b, a=1.0)

    made = triangles(vertices, faces, colours)

    assert made.SerializeToString(deterministic=True) == expected.SerializeToString(deterministic=True)
    assert len(triangles(vertices[:0], faces[:0], colours[:0]).points) == 0


def test_a_run_on_a_mesh_keeps_the_costs_it_was_planned_on(meadow):
    with Session(meadow) as session:
        assert session.navigator.get_path(session.goals[0]).success
        view, recorded = session.navigator.server.map_view(), session.recorder.meshes

    assert len(recorded) == 1
    np.testing.assert_array_equal(recorded[0].faces, view.faces)
    np.testing.assert_allclose(recorded[0].costs, view.costs, rtol=1e-3, atol=1e-3)


def test_what_the_robot_knows_of_things_that_move_is_shown_until_it_knows_of_none(office, tmp_path):
    walks = TrackedObject(7, Motion.MOVING, 1.0, 2.0, 0.0, 0.0, 0.6, 0.25, 3.0, 0.0, 0.0, 0.0, "map")
    stands = replace(walks, number=9, x=4.0, vy=0.0, motion=Motion.PARKED)
    office.objects.extend([RecordedObjects.of(0.4, [walks, stands]), RecordedObjects.of(1.4, [])])
    write_mcap(tmp_path / "objects.mcap", office)

    shown, gone = Log(tmp_path / "objects.mcap")["/objects"]

    moving, parked = shown.entities
    assert (moving.id, moving.frame_id) == ("object 7", "map")
    (arrow,) = moving.arrows
    assert arrow.shaft_length + arrow.head_length == pytest.approx(0.6)
    assert (arrow.pose.orientation.z, arrow.pose.orientation.w) == pytest.approx((np.sqrt(0.5), np.sqrt(0.5)))
    facts = {pair.key: pair.value for pair in moving.metadata}
    assert facts == {"motion": "moving", "vx": "0.000", "vy": "0.600", "age": "3.00"}
    assert not parked.arrows and parked.cylinders[0].size.x == 0.5
    assert [deletion.type for deletion in gone.deletions] == [1] and not gone.entities, "1 = all of the topic"


def test_events_and_the_log_hold_what_events_jsonl_holds(log, office):
    levels = {message.message.split(":")[0]: message.level for message in log["/log"]}

    assert [Event.from_json(json.dumps(values)) for values in log["/events"]] == list(office.events)
    assert (levels["goal_accepted"], levels["robot_stopped"], levels["plugin_call_started"]) == (2, 3, 1)
    assert log["/log"][-1].level == 3, "the goal failed"
    assert log.metadata["run"]["verdict"] == "BLOCKED_PATH: a box stands on the path"


def test_actions_are_active_from_acceptance_to_their_outcome(log):
    states = [(stamp / 1e9, message["get_path"], message["exe_path"]) for stamp, message in log.messages["/actions"]]

    assert states[0] == (0.0, "idle", "idle")
    assert (0.4, "SUCCESS", "active") in states
    assert states[-1] == (15.4, "SUCCESS", "BLOCKED_PATH")


def test_a_goal_that_was_replaced_does_not_end_its_action():
    events = (
        Event(1.0, EventKind.GOAL_ACCEPTED, "exe_path", {"goal_id": 1}),
        Event(2.0, EventKind.GOAL_ACCEPTED, "exe_path", {"goal_id": 2}),
        Event(2.1, EventKind.GOAL_FINISHED, "exe_path", {"goal_id": 1, "outcome": 101}),
        Event(3.0, EventKind.GOAL_FINISHED, "exe_path", {"goal_id": 2, "outcome": 0}),
    )

    actions = ActionStates()
    states = [(event.time, actions.states["exe_path"]) for event in events if actions.take(event)]

    assert states == [(1.0, "active"), (2.0, "active"), (3.0, "SUCCESS")]


def test_the_motion_is_plotted_in_plain_numbers(log, office):
    motion = log["/motion"]

    assert [message["speed"] for message in motion] == office.twists[:, 0].tolist()
    assert "cross_track_error" not in motion[0] and motion[-1]["cross_track_error"] >= 0.0


def test_a_hill_of_ten_thousand_triangles_is_well_below_a_megabyte(hill_recording, tmp_path):
    write_mcap(tmp_path / "run.mcap", hill_recording)

    log = Log(tmp_path / "run.mcap")
    ground = next(entity for entity in log["/scene"][0].entities if entity.id == "ground").triangles[0]
    assert len(ground.points) == len(ground.colors) == len(hill_recording.ground.vertices)
    assert (tmp_path / "run.mcap").stat().st_size < 1e6


def test_a_run_that_never_began_has_a_log_too(tmp_path):
    run = Recorder("nothing", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), []).finish(Verdict(100, "no robot"))
    write_mcap(tmp_path / "run.mcap", run)

    assert Log(tmp_path / "run.mcap").metadata["run"]["verdict"] == "FAILURE: no robot"


def test_the_same_recording_gives_the_same_bytes(office, tmp_path):
    for name in ("first.mcap", "second.mcap"):
        write_mcap(tmp_path / name, office)

    assert (tmp_path / "first.mcap").read_bytes() == (tmp_path / "second.mcap").read_bytes()


def test_a_recording_that_was_read_again_gives_the_same_bytes(office, tmp_path):
    """At the end of a run the fields of its events stand as they came, and sorted when they were read from the file."""
    event = Event(0.1, EventKind.GOAL_STARTED, "get_path", {"slot": 255, "goal_id": 1, "plugin": "theta_star"})
    run = replace(office, events=(event, *office.events))
    run.save(tmp_path / "recording.npz")
    write_mcap(tmp_path / "first.mcap", run)
    write_mcap(tmp_path / "second.mcap", Recording.load(tmp_path / "recording.npz"))

    assert (tmp_path / "first.mcap").read_bytes() == (tmp_path / "second.mcap").read_bytes()


def test_people_and_doors_are_drawn_in_frames_that_move_as_recorded(office_recording, tmp_path):
    poses = office_recording.poses + np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    person = ActorTrack("person", office_recording.obstacles.vertices, office_recording.obstacles.faces, poses)
    write_mcap(tmp_path / "run.mcap", replace(office_recording, actors=[person]))

    log = Log(tmp_path / "run.mcap")
    moves = [
        transform for message in log["/tf"] for transform in message.transforms if transform.child_frame_id == "actor_0"
    ]
    drawn = {entity.id: entity.frame_id for message in log["/scene"] for entity in message.entities}
    assert drawn["person 0"] == "actor_0"
    np.testing.assert_array_equal([[m.translation.x, m.translation.y, m.translation.z] for m in moves], poses[:, :3])
