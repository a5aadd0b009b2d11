"""What goes into a replay: frames, texts and turning wheels; the page itself is opened in tests/browser."""

import base64
import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest
import zstandard

from mbf_abstract.geometry import Pose
from terrain.physics.robot_models import HUSKY
from terrain.recording.actor_track import ActorTrack
from terrain.recording.recorder import Recorder
from terrain.recording.recording import RobotShape
from terrain.recording.verdict import Verdict
from terrain.viewer.replay import FRAME_RATE, MAX_FRAMES, frame_indices, replay_html, status_text
from terrain.viewer.scene import wheel_angles
from terrain.worlds.surface import cylinder


def test_frames_come_at_the_frame_rate_with_first_and_last():
    times = np.arange(0.0, 10.0, 0.01)

    shown = frame_indices(times)

    assert (shown[0], shown[-1]) == (0, len(times) - 1)
    np.testing.assert_allclose(np.diff(times[shown])[:-1], 1.0 / FRAME_RATE)


def test_a_long_run_gets_no_more_frames_than_the_limit():
    assert len(frame_indices(np.arange(0.0, 3600.0, 0.1))) <= MAX_FRAMES + 2


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


@pytest.mark.parametrize("name", ["hill_recording", "office_recording"])
def test_a_replay_is_one_html_file_of_a_few_megabytes(name, request, tmp_path, capsys):
    (tmp_path / "replay.html").write_text(replay_html(request.getfixturevalue(name)), encoding="utf-8")

    page = (tmp_path / "replay.html").read_text(encoding="utf-8")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert "__VISER_EMBED_DATA__" in page
    assert len(page) < 4e6
    assert capsys.readouterr().out == ""


def test_a_run_that_never_began_has_a_replay_too():
    run = Recorder("nothing", "mesh", RobotShape.of(HUSKY), Pose.planar(0, 0), []).finish(Verdict(100, "no robot"))

    assert "__VISER_EMBED_DATA__" in replay_html(replace(run, goals=()))


def test_people_doors_and_other_robots_move_through_the_replay(hill_recording):
    count = len(hill_recording.times)
    poses = np.tile([0.0, 5.0, 0.85, 0.0, 0.0, 0.0, 1.0], (count, 1))
    poses[:, 0] = np.linspace(1.0, 9.0, count)
    person = ActorTrack("person", *cylinder(0.25, 1.7), poses)

    messages = messages_of(replay_html(replace(hill_recording, actors=[person])))

    places = [
        message["position"] for message in messages if message.get("name") == "/actor_0" and "position" in message
    ]
    assert any(message.get("name") == "/actor_0/person" for message in messages)
    assert len(places) >= len(frame_indices(hill_recording.times)) - 2
    assert places[0][0] == pytest.approx(1.0, abs=0.1) and places[-1][0] == pytest.approx(9.0, abs=0.1)


def messages_of(page):
    """What viser packed into a page: its length, then messages and buffers compressed together."""
    packed = base64.b64decode(page.split('__VISER_EMBED_DATA__="')[1].split('"')[0])
    content = zstandard.ZstdDecompressor().decompressobj().decompress(packed[8:])
    length = int.from_bytes(content[:8], "little")
    return [message for _, message in msgspec.msgpack.decode(content[8 : 8 + length])["messages"]]
