import json
import threading

import numpy as np
import pytest

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import JsonLinesSink, MemorySink, read_events
from mbf_abstract.event_values import error_text, to_json_value
from mbf_abstract.events import Event, EventKind
from mbf_abstract.outcomes import GetPathOutcome


class RaisingSink:
    def __init__(self):
        self.calls = 0

    def write(self, event):
        self.calls += 1
        raise RuntimeError("no more")

    def close(self):
        raise RuntimeError("not even closing")


def bus_with(*sinks, time=1.5):
    return EventBus(lambda: time, sinks)


def test_an_event_carries_the_time_of_the_injected_clock():
    memory = MemorySink()
    bus_with(memory, time=12.25).emit(EventKind.GOAL_ACCEPTED, "get_path", goal_id=7, slot=0)
    assert memory.events == (Event(12.25, EventKind.GOAL_ACCEPTED, "get_path", {"goal_id": 7, "slot": 0}),)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (1 / 3, 0.333333333),
        (-0.0, 0.0),
        (float("nan"), "nan"),
        (float("-inf"), "-inf"),
        (np.float32(0.5), 0.5),
        (np.int64(3), 3),
        (np.bool_(True), True),
        (np.array([[1.0, 2.0]]), [[1.0, 2.0]]),
        ((1, (2.0, None)), [1, [2.0, None]]),
        ({1: np.array([1])}, {"1": [1]}),
        (GetPathOutcome.NO_PATH_FOUND, "NO_PATH_FOUND"),
        (ValueError("text"), "text"),
        (True, True),
    ],
)
def test_values_become_plain_json(value, expected):
    result = to_json_value(value)
    assert result == expected
    assert type(result) is type(expected)
    json.dumps(result, allow_nan=False)


@pytest.mark.parametrize(
    "value", [None, True, False, "", "plain", "x" * 10_000, "x" * 10_001, "caf\u00e9", "half \ud800", np.str_("text")]
)
def test_a_value_alone_becomes_what_it_becomes_in_a_list(value):
    alone, within = to_json_value(value), to_json_value([value])
    assert within == [alone] and type(within[0]) is type(alone)


def holding_itself():
    endless = []
    endless.append(endless)
    return endless


class Unspeakable:
    def __str__(self):
        raise SystemExit("no text")


class RaisingMapping(dict):
    def items(self):
        raise RuntimeError("no items")


@pytest.mark.parametrize(
    ("value", "reported"),
    [
        (10**5000, "integer of 16610 bits"),
        (-(2**63) - 1, "integer of 64 bits"),
        ("x" * 30_000_000, "(29990000 more characters)"),
        ({"a": "x" * 20_000}, "(10000 more characters)"),
        ({"x" * 20_000: 1}, "(10000 more characters)"),
        (np.zeros((3000, 4000)), "array of shape (3000, 4000)"),
        ([0.123456789] * 1_000_000, "more values left out"),
        ({number: number for number in range(100_000)}, "more values left out"),
        ([["x" * 9_000] * 100] * 100, "more values left out"),
        (holding_itself(), "list nested deeper than 30"),
        (Unspeakable(), "Unspeakable whose text raises SystemExit"),
        ([RaisingMapping()], "list that cannot be described: RuntimeError"),
        (np.longdouble(0.5), "0.5"),
        ("\ud800", "ud800"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_no_value_ends_the_record_of_the_run(value, reported, tmp_path):
    bus = bus_with(sink := JsonLinesSink(tmp_path / "events.jsonl"))
    bus.emit(EventKind.CUSTOM, "test", value=value)
    bus.emit(EventKind.CUSTOM, "test", value="the next one")
    assert bus.sinks == (sink,)
    bus.close()
    first, second = (tmp_path / "events.jsonl").read_text().splitlines()
    assert reported in first
    assert len(first) < 500_000
    assert "the next one" in second
    assert len(list(read_events(tmp_path / "events.jsonl"))) == 2


def test_the_text_of_an_error_never_raises_and_is_never_long():
    assert error_text(ValueError("short")) == "short"
    assert len(error_text(ValueError("x" * 1_000_000))) < 10_100
    assert error_text(type("Bad", (BaseException,), {"__str__": lambda self: 1})()) == "Bad whose text raises TypeError"


def test_memory_forgets_the_oldest_and_selects_by_kind():
    memory = MemorySink(maxlen=3)
    bus = bus_with(memory)
    for number in range(5):
        bus.emit(EventKind.CUSTOM if number % 2 else EventKind.FAULT, "test", number=number)
    assert [event.data["number"] for event in memory.events] == [2, 3, 4]
    assert [event.data["number"] for event in memory.of_kind(EventKind.CUSTOM)] == [3]


def test_equal_runs_write_equal_bytes_and_read_back_as_equal_events(tmp_path):
    contents = []
    for run in ("a", "b"):
        memory = MemorySink()
        bus = bus_with(memory, JsonLinesSink(tmp_path / run / "events.jsonl"))
        bus.emit(EventKind.PLAN, "planner", cost=0.1 + 0.2, length=np.float64(3), poses=4)
        bus.emit(EventKind.STATE_CHANGED, "exe_path", b=1, a=[1.0, float("inf")])
        bus.close()
        contents.append((tmp_path / run / "events.jsonl").read_bytes())
        assert tuple(read_events(tmp_path / run / "events.jsonl")) == memory.events
    assert contents[0] == contents[1]
    assert contents[0].splitlines()[0] == (
        b'{"data":{"cost":0.3,"length":3.0,"poses":4},"kind":"plan","source":"planner","time":1.5}'
    )


def test_a_raising_sink_is_removed_and_the_others_hear_of_it_once():
    memory, broken = MemorySink(), RaisingSink()
    bus = bus_with(broken, memory)
    bus.emit(EventKind.CUSTOM, "test")
    bus.emit(EventKind.CUSTOM, "test")
    assert broken.calls == 1
    assert bus.sinks == (memory,)
    assert [event.kind for event in memory.events] == [EventKind.SINK_FAILED, EventKind.CUSTOM, EventKind.CUSTOM]
    assert memory.events[0].data == {"sink": "RaisingSink", "message": "RuntimeError: no more"}


def test_two_raising_sinks_do_not_call_each_other_for_ever():
    bus = bus_with(RaisingSink(), RaisingSink())
    bus.emit(EventKind.CUSTOM, "test")
    assert [type(sink) for sink in bus.sinks] == [MemorySink]


def test_a_sink_that_emits_is_removed_instead_of_recursing_for_ever():
    class EchoSink(RaisingSink):
        def write(self, event):
            bus.emit(EventKind.CUSTOM, "echo")

    bus = bus_with(MemorySink(), EchoSink())
    bus.emit(EventKind.CUSTOM, "test")
    assert [type(sink) for sink in bus.sinks] == [MemorySink]


@pytest.mark.parametrize("reason", ["size limit", "no folder"])
def test_a_file_that_cannot_be_written_degrades_to_memory(tmp_path, reason):
    (tmp_path / "file").write_text("in the way of a folder")
    sink = JsonLinesSink(tmp_path / "e.jsonl", max_bytes=150) if reason == "size limit" else None
    bus = bus_with(sink or JsonLinesSink(tmp_path / "file" / "e.jsonl"))
    for number in range(4):
        bus.emit(EventKind.CUSTOM, "test", number=number)
    numbers = [event.data["number"] for event in bus.memory.of_kind(EventKind.CUSTOM)]
    assert numbers == ([2, 3] if sink else [0, 1, 2, 3])
    assert len(bus.memory.of_kind(EventKind.SINK_FAILED)) == 1


def test_sinks_can_be_added_removed_and_closed():
    memory = MemorySink()
    bus = bus_with()
    bus.add_sink(memory)
    bus.emit(EventKind.CUSTOM, "test")
    bus.remove_sink(memory)
    bus.remove_sink(memory)
    bus.emit(EventKind.CUSTOM, "test")
    bus.close()
    bus.close()
    assert len(memory.events) == 1
    assert bus.memory is None


def test_a_closed_file_takes_no_more_events(tmp_path):
    sink = JsonLinesSink(tmp_path / "e.jsonl")
    sink.close()
    with pytest.raises(OSError, match="is closed"):
        sink.write(Event(0.0, EventKind.CUSTOM, "test"))


def test_reading_a_broken_file_names_the_line(tmp_path):
    file = tmp_path / "events.jsonl"
    file.write_text(Event(0.0, EventKind.CUSTOM, "test").to_json() + "\nnot json\n")
    with pytest.raises(ValueError, match=r"events\.jsonl:2: not an event"):
        list(read_events(file))


def test_events_of_many_threads_are_all_kept_in_one_order():
    first, second = MemorySink(), MemorySink()
    bus = bus_with(first, second)
    threads = [
        threading.Thread(target=lambda name=name: [bus.emit(EventKind.CUSTOM, name, i=i) for i in range(200)])
        for name in "abcd"
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(first.events) == 800
    assert first.events == second.events


def test_memory_can_be_read_while_other_threads_write():
    memory = MemorySink()
    bus = bus_with(memory)
    writers = [
        threading.Thread(target=lambda: [bus.emit(EventKind.CUSTOM, "test", number=n) for n in range(2000)])
        for _ in range(3)
    ]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        assert len(memory.of_kind(EventKind.CUSTOM)) <= 6000
    assert len(memory.events) == 6000
