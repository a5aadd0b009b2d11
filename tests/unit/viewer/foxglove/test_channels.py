"""What waits for a client that does not read, what one who comes late is sent, and messages that cannot be made."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.access.page_access import Role
from terrain.viewer.foxglove.channels import HISTORY, NUMBERS, WAITING, Channels, FoxgloveClient
from terrain.viewer.logs import run_messages
from terrain.viewer.logs.event_messages import JsonMessage, Stamped
from terrain.viewer.logs.run_messages import TOPICS, RunMessages


def client_of(channels, *topics):
    client = FoxgloveClient("app", Role.WATCH, lambda reason: None)
    channels.welcome(client)
    for topic in topics:
        channels.subscribe(client, NUMBERS[topic], NUMBERS[topic])
    return client


def waiting(client):
    """Topics and times [s] of the messages that wait."""
    frames = []
    while not client.outbox.is_empty:
        frames.append(client.outbox.pop())
    headers = [struct.unpack_from("<IQ", frame, 1) for frame in frames if frame[0] == 1]
    return [(next(name for name, one in NUMBERS.items() if one == number), stamp / 1e9) for number, stamp in headers]


def message(topic, time, part=None):
    return Stamped(time, topic, lambda: JsonMessage("test", {}), part)


@pytest.mark.parametrize("topic", TOPICS)
def test_of_a_state_the_newest_waits_for_one_who_does_not_read_and_of_events_a_thousand(topic):
    channels = Channels(on_fault=pytest.fail)
    client = client_of(channels, topic)
    state = {"/log", "/events", "/motion"}.isdisjoint({topic})
    channels.publish(message(topic, float(time), "" if state else None) for time in range(2 * HISTORY))
    times = [time for _, time in waiting(client)]
    assert times == list(range(2 * HISTORY))[-len(times) :]
    assert len(times) == (HISTORY if not state else WAITING.get(topic, 1))


def test_the_parts_of_a_state_wait_each_for_itself():
    channels = Channels(on_fault=pytest.fail)
    client = client_of(channels, "/scene")
    channels.publish(message("/scene", float(turn), part) for turn in range(3) for part in ("robot", "world"))
    assert waiting(client) == [("/scene", 2.0), ("/scene", 2.0)]


def test_a_message_that_cannot_be_made_takes_no_other_along():
    faults = []
    channels = Channels(faults.append)
    client = client_of(channels, "/plan", "/scene")
    damaged = Stamped(1.0, "/plan", lambda: 1 / 0, "")
    channels.publish([damaged, message("/scene", 2.0, "world")])

    assert waiting(client) == [("/scene", 2.0)] and type(faults[0]) is ZeroDivisionError
    assert waiting(client_of(channels, "/plan", "/scene")) == [("/scene", 2.0)]


def test_where_a_part_cannot_be_made_the_world_comes_with_the_next(hill_recording):
    maker = RunMessages(hill_recording)
    with pytest.raises(TypeError):
        maker.take(replace(hill_recording, scans=None))
    assert {"world", "robot"} <= {one.part for one in maker.take(hill_recording)}


def driven(recording, times, x):
    """A part in which nothing but the robot moves."""
    poses = np.zeros((len(times), 7))
    poses[:, 0], poses[:, 3] = x, 1.0
    still = np.zeros((len(times), 3))
    nothing = dict(paths=[], scans=[], events=(), grids=[], meshes=[], actors=[], objects=[])
    return replace(recording, times=times, poses=poses, twists=still, commands=still, **nothing)


def pieces(maker, part):
    return [one.part for one in maker.take(part) if (one.part or "").startswith("track")]


def test_a_robot_that_stands_leaves_no_track_and_one_that_drives_for_days_a_bounded_one(hill_recording, monkeypatch):
    monkeypatch.setattr(run_messages, "MAX_PIECES", 10)
    maker, hour = RunMessages(hill_recording), np.arange(0.0, 3600.0)
    jitter = 0.01 * np.sin(hour)
    assert pieces(maker, driven(hill_recording, hour, jitter)) == []
    found = pieces(maker, driven(hill_recording, 3600.0 + hour, hour))
    assert len(found) > 100 and set(found) == {f"track {number}" for number in range(10)}


def test_the_track_goes_on_after_the_calendar_was_set_back(hill_recording):
    maker, times = RunMessages(hill_recording), np.arange(0.0, 20.0)
    pieces(maker, driven(hill_recording, 1e6 + times, times))
    assert len(pieces(maker, driven(hill_recording, times, 20.0 + times))) >= 3
