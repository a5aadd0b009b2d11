"""What a replay's report and its ``statistics.json`` say."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from mbf_abstract.drive_log import LogReport, LogTable
from mbf_ros.bags.replay import Replayed

TOPIC_HEADER = ("topic", "type", "used as", "messages", "Hz", "largest gap [s]", "mean delay [s]", "largest delay [s]")
ROUNDING = 0.006  # m, of a length with two digits
FRAME_HEADER = ("frame", "parent", "transforms", "Hz", "largest gap [s]", "largest delay [s]")


def statistics_of(replayed: Replayed) -> dict[str, Any]:
    """Return everything that was counted, for JSON."""
    return {
        "duration_s": round(replayed.duration, 6),
        "stamp_shift_s": round(replayed.stamp_shift, 6),
        "topics": {topic: one.to_json() for topic, one in replayed.topics.items()},
        "frames": {frame: replayed.frames[frame].to_json() for frame in sorted(replayed.frames)},
        "samples": len(replayed.log.times),
        "samples_without_pose": replayed.poses_unknown,
        "sources_without_topic": list(replayed.sources_without_topic),
        "faults": list(replayed.faults),
    }


def report_of(replayed: Replayed) -> LogReport:
    """Return what the report says."""
    tables = [
        LogTable("Topics", TOPIC_HEADER, list(_topics(replayed))),
        LogTable("Messages that were not used", ("topic", "reason", "messages", "the first"), list(_dropped(replayed))),
        LogTable("Transforms", FRAME_HEADER, list(_frames(replayed))),
        LogTable("Faults", ("what",), [(fault,) for fault in replayed.faults]),
    ]
    return LogReport(result_line(replayed), list(_notes(replayed)), tables)


def result_line(replayed: Replayed) -> str:
    """One line on what was replayed, and on the plan."""
    used = sum(one.recorded.count for one in replayed.topics.values() if one.used_as)
    dropped = sum(one.dropped.total() for one in replayed.topics.values())
    partly = sum(one.dropped_by_map.total() for one in replayed.topics.values())
    line = f"{used} messages in {replayed.duration:.1f} s replayed, {dropped} not used"
    if partly:
        line += f", {partly} not used by one of the maps"
    if replayed.plan is None:
        return line
    plan = replayed.plan
    length, named = plan["length_m"], re.findall(r"(\d+\.\d\d) m\b", plan["message"])  # some planners name it
    is_named = length is None or any(abs(float(one) - length) <= ROUNDING for one in named)
    shown = "" if is_named else f", {length:.2f} m"
    return f"{line}; plan at {plan['at_s']:.1f} s: {plan['outcome_name']}{shown}: {plan['message']}"


def missing_notes(replayed: Replayed) -> list[str]:
    """One note for each source of the configuration that is not in the bag."""
    return [
        f"The bag has no topic for the source {source!r}: nothing of it is in the maps."
        for source in replayed.sources_without_topic
    ]


def _notes(replayed: Replayed) -> Iterator[str]:
    yield from missing_notes(replayed)
    if replayed.stamp_shift:
        yield (
            f"Stamps are of another clock than that of the recording; they were moved by {replayed.stamp_shift:.3f} s."
        )
    if replayed.poses_unknown:
        share = replayed.poses_unknown / (replayed.poses_unknown + len(replayed.log.times))
        yield f"The robot's pose was unknown, or too old, for {share:.0%} of the time."
    for topic, one in replayed.topics.items():
        if one.placed_by_newest:
            yield (
                f"{one.placed_by_newest} of {one.recorded.count} scans on {topic} came before the transforms of their "
                "moment and were placed by the newest ones."
            )
    if replayed.plan is not None and replayed.plan["note"]:
        yield replayed.plan["note"]


def _topics(replayed: Replayed) -> Iterable[tuple[Any, ...]]:
    for topic, one in replayed.topics.items():
        gap = _seconds(one.recorded.largest_gap)
        row = (topic, one.type, one.used_as or "-", one.recorded.count, round(one.recorded.rate, 2), gap)
        stamped = one.delays.count > 0
        yield (*row, *(_seconds(value) if stamped else "-" for value in (one.delays.mean, one.delays.largest)))


def _dropped(replayed: Replayed) -> Iterable[tuple[Any, ...]]:
    for topic, one in replayed.topics.items():
        for dropped in (one.dropped, one.dropped_by_map):
            for reason in sorted(dropped):
                yield topic, reason, dropped[reason], one.examples[reason]


def _frames(replayed: Replayed) -> Iterable[tuple[Any, ...]]:
    for frame in sorted(replayed.frames):
        one = replayed.frames[frame]
        if one.static:
            yield frame, one.parent, "static", "-", "-", "-"
            continue
        gap, delay = _seconds(one.stamps.largest_gap), _seconds(one.delays.largest)
        yield frame, one.parent, one.stamps.count, round(one.stamps.rate, 2), gap, delay


def _seconds(value: float) -> str:
    return f"{value:.3f}"
