"""What goes into a replay: frames, texts and turning wheels; the page itself is opened in tests/browser."""

import base64
import math
import re
import zlib
from dataclasses import replace
from html import escape

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from terrain.physics.robot_models import HUSKY
from terrain.recording.actor_track import ActorTrack
from terrain.recording.joint_recording import JointRecording
from terrain.recording.recorded_objects import RecordedObjects
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.verdict import Verdict
from terrain.viewer.pictures.colours import FLEET
from terrain.viewer.pictures.moving_picture import status_text
from terrain.viewer.replay.packing import Packer
from terrain.viewer.replay.replay_page import joint_replay_html, replay_html
from terrain.viewer.replay.scene_content import (
    FRAME_RATE,
    LEAST_STEP,
    MAX_FRAMES,
    MAX_SCANS,
    contour_step,
    frame_indices,
    seen_plans,
    thinned_plans,
)
from terrain.viewer.replay.world_mesh import coarse_faces
from terrain.viewer.scene import wheel_angles
from terrain.worlds.surface import Surface, cylinder


def test_frames_come_at_the_frame_rate_with_first_and_last():
    times = np.arange(0.0, 10.0, 0.01)

    shown = frame_indices(times)

    assert (shown[0], shown[-1]) == (0, len(times) - 1)
    np.testing.assert_allclose(np.diff(times[shown])[:-1], 1.0 / FRAME_RATE)


def test_a_long_run_gets_no_more_frames_than_the_limit():
    assert len(frame_indices(np.arange(0.0, 3600.0, 0.1))) <= MAX_FRAMES + 2


times = st.lists(st.floats(0.0, 20.0), max_size=30).map(sorted)


@settings(max_examples=60)
@given(times, times)
def test_a_plan_that_is_replaced_before_the_next_frame_is_left_out(begins, frames):
    plans = [(begin, np.full((2, 3), float(number))) for number, begin in enumerate(begins)]
    wanted = {max((k for k, begin in enumerate(begins) if begin <= time), default=None) for time in frames}
    wanted = (wanted - {None}) | ({len(plans) - 1} if plans else set())

    found = [int(points[0, 0]) for _, points in seen_plans(plans, np.array(frames))]

    assert found == sorted(wanted)


def naive_thinned(points, step):
    """The first point in each step of the way, and both ends."""
    way, last, kept = 0.0, -1, []
    for number, point in enumerate(points):
        way += np.abs(point - points[max(number - 1, 0)]).max()
        if math.floor(way / step + 1e-6) > last or number == len(points) - 1:
            kept.append(point)
        last = math.floor(way / step + 1e-6)
    return np.array(kept).reshape(-1, 3)


@settings(max_examples=60)
@given(hnp.arrays(np.float64, st.tuples(st.integers(0, 40), st.just(3)), elements=st.floats(-0.3, 0.3)))
def test_a_plan_keeps_its_ends_and_a_point_for_each_step_of_its_way(steps):
    points = np.cumsum(steps, axis=0)

    ((_, kept),) = thinned_plans([(0.0, points)])

    np.testing.assert_array_equal(kept, naive_thinned(points, LEAST_STEP))


def test_plans_with_a_point_for_each_step_keep_all_points():
    line = np.column_stack([LEAST_STEP * np.arange(500), np.zeros((500, 2))])

    assert len(thinned_plans([(0.0, line)])[0][1]) == 500


@settings(max_examples=30)
@given(st.lists(st.integers(0, 300), min_size=1, max_size=8), st.integers(16, 500))
def test_all_plans_together_have_no_more_points_than_the_limit_and_keep_their_ends(lengths, most):
    plans = [(float(k), np.arange(3.0 * length).reshape(-1, 3)) for k, length in enumerate(lengths)]

    thinned = thinned_plans(plans, most)

    assert sum(len(points) for _, points in thinned) <= most
    for (_, points), (_, kept) in zip(plans, thinned, strict=True):
        np.testing.assert_array_equal(kept[:1], points[:1])
        np.testing.assert_array_equal(kept[-1:], points[-1:])


def test_a_scan_is_shown_until_the_next_one_that_is_kept_in_a_long_run(hill_recording, contents_of):
    long = np.arange(0.0, 1800.0, 1.0)
    scans = [(float(time), np.zeros((1, 3))) for time in long]

    for run, hold in ((replace(hill_recording, scans=scans[:20]), 2.0), (replace(hill_recording, scans=scans), 9.0)):
        scene, arrays = contents_of(replay_html(run))
        (robot,) = scene["robots"]
        kept = arrays[robot["scans"]["times"]][:, 0] / 1e3
        assert len(kept) <= MAX_SCANS
        assert robot["scanHold"] == hold and np.diff(kept).max() < hold


def test_a_wheel_that_rolls_its_circumference_has_turned_once():
    shape = RobotShape.of(HUSKY)
    times = np.linspace(0.0, 1.0, 11)
    forward = np.tile([2 * math.pi * shape.wheel_radius, 0.0, 0.0], (11, 1))

    np.testing.assert_allclose(wheel_angles(shape, times, forward)[-1], 2 * math.pi)


def test_wheels_turn_against_each_other_when_the_robot_turns_on_the_spot():
    shape = RobotShape.of(HUSKY)
    turning = np.tile([0.0, 0.0, 1.0], (11, 1))

    angles = wheel_angles(shape, np.linspace(0.0, 1.0, 11), turning)[-1]

    np.testing.assert_array_equal(np.sign(angles), -np.sign(shape.wheels[:, 1]))


def test_the_text_over_the_robot_shows_time_speed_and_tilt(hill_recording):
    assert status_text(hill_recording, 100).startswith("10 s   1.2 m/s   tilt ")


@pytest.mark.parametrize("name", ["hill_recording", "office_recording", "garage_recording"])
def test_a_replay_is_one_small_html_file_and_the_same_bytes_every_time(name, request):
    page = replay_html(request.getfixturevalue(name))

    assert page.lstrip().lower().startswith("<!doctype html>")
    assert len(page) < 3e5
    assert page == replay_html(request.getfixturevalue(name))
    assert "{{" not in page and "http" not in re.sub(r"http-equiv", "", page), "no address of another page"


def test_a_replay_shows_each_frame_where_the_robot_was(hill_recording, contents_of):
    scene, arrays = contents_of(replay_html(hill_recording))

    robot, frames = scene["robots"][0], frame_indices(hill_recording.times)
    lower = hill_recording.ground.vertices.min(axis=0)
    np.testing.assert_allclose(arrays[scene["times"]][:, 0] / 1e3, hill_recording.times[frames], atol=6e-4)
    positions = arrays[robot["positions"]] / 1e3 + lower
    np.testing.assert_allclose(positions, hill_recording.poses[frames, :3], atol=6e-4)
    np.testing.assert_allclose(arrays[robot["orientations"]] / 32767, hill_recording.poses[frames, 3:], atol=2e-5)
    vertices = arrays[scene["world"]["vertices"]] / 65535 * scene["size"] + lower
    np.testing.assert_allclose(vertices, hill_recording.ground.vertices, atol=1e-3)
    np.testing.assert_array_equal(arrays[scene["world"]["levels"][0][1]], hill_recording.ground.faces)


def test_the_first_view_of_a_replay_has_the_way_to_the_goal_from_left_to_right(hill_recording, contents_of):
    scene, _ = contents_of(replay_html(hill_recording))

    start, goal = hill_recording.start, hill_recording.goals[-1]
    looks = scene["route"]["yaw"] + math.pi / 2.0, math.atan2(goal.y - start.y, goal.x - start.x)
    assert math.remainder(looks[0] - looks[1], math.tau) == pytest.approx(0.0, abs=1e-6), looks


def test_a_run_that_never_began_has_a_replay_too(contents_of):
    run = Recorder("nothing", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), []).finish(Verdict(100, "no robot"))

    scene, arrays = contents_of(replay_html(replace(run, goals=())))
    assert [mark["name"] for mark in scene["marks"]] == ["start"]
    assert len(arrays[scene["times"]]) == 0


def test_people_doors_and_other_robots_move_through_the_replay(hill_recording, contents_of):
    count = len(hill_recording.times)
    poses = np.tile([0.0, 5.0, 0.85, 0.0, 0.0, 0.0, 1.0], (count, 1))
    poses[:, 0] = np.linspace(1.0, 9.0, count)
    person = ActorTrack("person", *cylinder(0.25, 1.7), poses)

    scene, arrays = contents_of(replay_html(replace(hill_recording, actors=[person])))

    (actor,) = scene["actors"]
    places = arrays[actor["positions"]] / 1e3 + hill_recording.ground.vertices.min(axis=0)
    np.testing.assert_allclose(places, poses[frame_indices(hill_recording.times), :3], atol=6e-4)
    body, arrow, eyes = (arrays[part["corners"]] / 1e3 for part in actor["parts"])
    assert arrow[:, 0].min() > 0.25 and arrow[:, 2].max() < -0.7, "on the floor, before the body"
    assert len(body) == 3 * 4 * 24 and eyes[:, 0].max() > 0.25


def test_what_the_robot_knows_to_move_has_an_arrow_in_the_replay_and_what_stands_has_none(hill_recording, contents_of):
    walks = TrackedObject(7, Motion.MOVING, 3.0, 2.0, 0.5, 0.0, 0.8, 0.25, 3.0, 0.0, 0.0, 0.0, "map")
    stands = replace(walks, number=8, vy=0.0, motion=Motion.WAITING)
    known = [RecordedObjects.of(1.0, [walks, stands]), RecordedObjects.of(2.0, [stands]), RecordedObjects.of(3.0, [])]

    scene, arrays = contents_of(replay_html(replace(hill_recording, objects=known)))

    objects = scene["robots"][0]["objects"]
    assert arrays[objects["times"]][:, 0].tolist() == [1000, 2000, 3000]
    assert arrays[objects["counts"]][:, 0].tolist() == [6, 0, 0], "a shaft and two barbs"
    points = arrays[objects["points"]] / 1e3 + hill_recording.ground.vertices.min(axis=0)
    np.testing.assert_allclose(points[1] - points[0], [0.0, 0.8, 0.0], atol=1e-3)
    np.testing.assert_allclose(points[[3, 5]], points[[1, 1]], atol=1e-3)
    assert points[2, 0] < points[0, 0] < points[4, 0]


def test_arrows_end_where_nobody_is_seen_any_more_however_long_the_run(hill_recording, contents_of):
    walks = TrackedObject(7, Motion.MOVING, 3.0, 2.0, 0.5, 0.0, 0.8, 0.25, 3.0, 0.0, 0.0, 0.0, "map")
    gone = 0.2 * MAX_FRAMES + 0.2  # an odd look
    known = [RecordedObjects.of(0.2 * index, [walks]) for index in range(MAX_FRAMES + 1)]
    known += [RecordedObjects.of(gone, []), RecordedObjects.of(gone + 60.0, [walks])]

    scene, arrays = contents_of(replay_html(replace(hill_recording, objects=known)))

    objects = scene["robots"][0]["objects"]
    times, counts = (arrays[objects[name]][:, 0] for name in ("times", "counts"))
    assert counts[times == round(1000 * gone)].tolist() == [0]
    assert len(times) < 0.6 * MAX_FRAMES


def test_all_robots_of_a_run_are_in_its_replay_each_in_its_colour_with_path_and_track(two_robots, contents_of):
    page = joint_replay_html(two_robots)
    scene, arrays = contents_of(page)

    assert [robot["name"] for robot in scene["robots"]] == ["a", "b"]
    assert [tuple(robot["ring"]) for robot in scene["robots"]] == list(FLEET[:2])
    a, b = (arrays[robot["positions"]] for robot in scene["robots"])
    np.testing.assert_array_equal(b - a, np.tile([0, 3000, 0], (len(a), 1)))
    assert all(arrays[robot["plans"]["counts"]].sum() > 50 for robot in scene["robots"])
    assert scene["actors"] == [], "the other robot is drawn once"
    assert ">a: plan<" in page and ">b: driven track<" in page


@pytest.mark.parametrize("text", ["</script><script>alert(1)</script>", "{{arrays}}", "$&"])
def test_a_name_cannot_become_part_of_the_page(hill_recording, two_robots, contents_of, text):
    page = replay_html(replace(hill_recording, scenario=text, verdict=Verdict(110, text)))
    joint = JointRecording({text: two_robots.robots["a"], "b": two_robots.robots["b"]}, Verdict(0, text))

    assert escape(text) in page
    for whole in (page, joint_replay_html(joint)):
        assert "alert(1)</script>" not in whole
        assert whole.count("</script>") == replay_html(hill_recording).count("</script>")
    scene, _ = contents_of(joint_replay_html(joint))
    assert scene["robots"][0]["name"] == text


integers = st.sampled_from([np.uint8, np.uint16, np.int16, np.int32, np.uint32])


@settings(max_examples=40)
@given(integers.flatmap(lambda kind: hnp.arrays(kind, st.tuples(st.integers(0, 9), st.integers(1, 4)))))
def test_arrays_come_out_of_a_page_as_they_went_in(values):
    packer = Packer()
    packer.add(values)
    raw, (entry,) = zlib.decompress(base64.b64decode(packer.text())), packer.entries()

    found = []
    for column in range(entry["columns"]):  # byte by byte, sum by sum
        total, count, size = 0, entry["columns"] * entry["rows"], values.itemsize
        for row in range(entry["rows"]):
            at = column * entry["rows"] + row
            total += int.from_bytes(bytes(raw[plane * count + at] for plane in range(size)), "little")
            found.append(total % 256**size)
    np.testing.assert_array_equal(np.array(found, object), values.T.astype(object).ravel() % 256**values.itemsize)


@settings(max_examples=40)
@given(st.integers(0, 2**32), st.floats(0.3, 3.0))
def test_a_coarse_level_is_the_fine_one_with_the_vertices_of_each_cell_made_one(seed, cell):
    rng = np.random.default_rng(seed)
    surface = Surface(rng.uniform(-4, 4, (30, 3)), rng.integers(0, 30, (60, 3)).astype(np.int32))
    paints = rng.integers(0, 2, 30).astype(np.uint8)
    lower = surface.vertices.min(axis=0)
    cells = {}
    for number, (vertex, paint) in enumerate(zip(surface.vertices, paints, strict=True)):
        cells.setdefault((*((vertex - lower) // cell), paint), []).append(number)
    chosen = {}
    for members in cells.values():
        mean = surface.vertices[members].mean(axis=0)
        best = min(members, key=lambda member: np.linalg.norm(surface.vertices[member] - mean))
        chosen |= dict.fromkeys(members, best)
    wanted = [[chosen[corner] for corner in face] for face in surface.faces.tolist()]

    found = coarse_faces(surface, paints, cell).tolist()

    assert found == [face for face in wanted if len(set(face)) == 3]


@pytest.mark.parametrize(
    ("relief", "step"), [(0.0, 0.0), (1.9, 0.0), (2.5, 0.25), (9.0, 1.0), (30.0, 5.0), (9e3, 100.0)]
)
def test_contour_lines_are_about_a_dozen_of_round_heights(relief, step):
    assert contour_step(relief) == step
