"""Messages of a run that come part by part while it goes on are those that its file holds."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.maps.view import GridView, MeshView
from terrain.recording.recorder import MAP_PERIOD, Recorder
from terrain.viewer.logs.run_messages import RunMessages, bytes_of, messages_of

WHEEL = "/tf"


def with_maps(recording):
    """A recording with a grid, and with a mesh whose costs change and change back."""
    recorder = Recorder("", "", recording.robot, recording.start, [])
    ground = recording.ground
    for turn in range(3):
        costs = ground.vertices[:, 0].astype(np.float32) + (turn == 1)
        mesh, grid = MeshView(ground.vertices, ground.faces, costs), GridView(np.full((2, 3), 0.2 * turn), (0, 3, 0, 2))
        recorder.map(2 * MAP_PERIOD * turn, lambda mesh=mesh: mesh)
        recorder.map(2 * MAP_PERIOD * turn + MAP_PERIOD, lambda grid=grid: grid)
    return replace(recording, meshes=recorder.meshes, grids=recorder.grids)


def between(recording, begin, end):
    """What a recording holds of a time."""
    now = (recording.times >= begin) & (recording.times < end)
    inside = lambda items: [one for one in items if begin <= one[0] < end]  # noqa: E731
    stamped = lambda items: [one for one in items if begin <= one.time < end]  # noqa: E731
    meshes = stamped(recording.meshes)
    if begin > 0.0:  # as a recorder gives them
        meshes = [replace(mesh, vertices=np.zeros((0, 3)), faces=np.zeros((0, 3), np.int32)) for mesh in meshes]
    return replace(
        recording,
        times=recording.times[now],
        poses=recording.poses[now],
        twists=recording.twists[now],
        commands=recording.commands[now],
        paths=inside(recording.paths),
        scans=inside(recording.scans),
        events=tuple(stamped(recording.events)),
        grids=stamped(recording.grids),
        meshes=meshes,
        actors=[replace(track, poses=track.poses[now]) for track in recording.actors],
    )


def by_topic(messages):
    """Time, part and message of all messages, topic by topic."""
    found = {}
    for one in messages:
        found.setdefault(one.topic, []).append((one.time, one.part, one.make()))
    return found


def as_bytes(messages):
    return [(time, part, bytes_of(made)) for time, part, made in messages]


@pytest.fixture(params=["office_recording", "hill_recording"])
def recording(request):
    return with_maps(request.getfixturevalue(request.param))


def test_parts_make_the_messages_of_the_whole(recording):
    whole = by_topic(messages_of(recording))

    @settings(max_examples=3, deadline=None)
    @given(st.lists(st.floats(0.0, recording.duration), max_size=12))
    def check(cuts):
        edges = [0.0, *sorted(cuts), np.inf]
        parts = [between(recording, *edge) for edge in pairwise(edges)]
        maker = RunMessages(parts[0])
        live = by_topic([*(one for part in parts for one in maker.take(part)), *maker.end()])
        assert sorted(live) == sorted(whole)
        for topic in set(whole) - {WHEEL}:
            assert as_bytes(live[topic]) == as_bytes(whole[topic]), topic
        assert_same_frames(live[WHEEL], whole[WHEEL])

    check()


def assert_same_frames(live, whole):
    """Wheels, whose angles are sums, may differ by rounding; everything else is equal."""
    assert [(time, part) for time, part, _ in live] == [(time, part) for time, part, _ in whole]
    for (_, _, here), (_, _, there) in zip(live, whole, strict=True):
        assert here.transforms[0] == there.transforms[0]
        turns = [[(one.rotation.y, one.rotation.w) for one in made.transforms[1:]] for made in (here, there)]
        np.testing.assert_allclose(*turns, atol=1e-9)


def test_nothing_is_made_before_somebody_asks_for_it(recording, monkeypatch):
    monkeypatch.setattr("terrain.viewer.logs.foxglove_messages.triangles", None)
    assert messages_of(recording)
