"""Fault table, row 28: the disk of the event log is full, or its folder read-only."""

import os

import pytest

from mbf_abstract.event_sinks import JsonLinesSink, read_events
from mbf_abstract.events import EventKind
from mbf_abstract.testing.scripted_session import ScriptedSession


class FillingDisk(JsonLinesSink):
    """A file system that takes the first few events."""

    def __init__(self, path):
        super().__init__(path)
        self.refused = 0

    def write(self, event):
        if self._written > 600:
            self.refused += 1
            raise OSError(28, "No space left on device")
        super().write(event)


def test_the_run_goes_on_and_the_log_degrades_to_memory_with_one_warning(tmp_path):
    with ScriptedSession() as session:
        disk = FillingDisk(tmp_path / "events.jsonl")
        session.events.remove_sink(session.memory)
        session.events.add_sink(disk)
        assert session.navigator.exe_path(session.path_to(2.0)).success
        assert disk.refused == 1  # the fault happened, once
        memory = session.events.memory
        assert [event.data["sink"] for event in memory.of_kind(EventKind.SINK_FAILED)] == ["FillingDisk"]
        assert memory.of_kind(EventKind.GOAL_FINISHED)
        on_disk = list(read_events(tmp_path / "events.jsonl"))
        assert on_disk[-1].time <= memory.events[0].time


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs the device of a full disk")
def test_a_device_without_space_is_survived():
    with ScriptedSession() as session:
        session.events.add_sink(JsonLinesSink("/dev/full"))
        assert session.navigator.exe_path(session.path_to(1.0)).success
        (failed,) = session.recorded(EventKind.SINK_FAILED)
        assert "No space left on device" in failed.data["message"]
