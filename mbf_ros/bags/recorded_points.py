"""What the sensors of a bag hit, as a point cloud in one frame: the input of ``mbf map build``.

Each scan is placed by the transforms at its stamp, those that were recorded later included. When not to use: to see
what a robot would have known at the time; that is a replay.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.whole_files import write_whole
from mbf_ros.bags.inputs import odometry_transform
from mbf_ros.bags.reading import Bag, BagError, Recorded
from mbf_ros.bags.recorded_time import RecordedTime, steady_messages
from mbf_ros.bags.replay_options import ReplayOptions
from mbf_ros.bags.statistics import reason_of
from mbf_ros.bags.topics import BagTopics, check_transforms, choose_topics
from mbf_ros.messages.geometry import odometry_of, transforms_of
from mbf_ros.messages.sensors import SENSORS

CLOUDS = "sensor_msgs/PointCloud2"
ROBOT_FRAME = "base_link"
"""Frame of the robot where odometry names none."""
MAX_POINTS = 50_000_000
HEADER = """\
ply
format binary_little_endian 1.0
comment points of a bag in the frame {frame}
element vertex {count}
property double x
property double y
property double z
end_header
"""


@dataclass(frozen=True)
class PointOptions:
    """Which points are taken.

    Attributes
    ----------
    frame : str
        In which they are written.
    topics : tuple of str
        Of the sensors; empty = all point clouds, or all scans where there is none.
    max_range : float
        Points farther from the sensor [m] are left out.
    every : int
        1 takes each scan, 2 every second one of a topic.
    """

    frame: str = "map"
    topics: tuple[str, ...] = ()
    max_range: float = np.inf
    every: int = 1


@dataclass(frozen=True)
class RecordedPoints:
    """The points (n, 3) float64 [m], how many scans they are of, and how many were left out, by the reason."""

    points: FloatArray
    scans: int
    left_out: Counter[str]


def read_recorded_points(
    bag: Bag, chosen: PointOptions, options: ReplayOptions, max_points: int = MAX_POINTS
) -> RecordedPoints:
    """Read the points of a bag.

    Parameters
    ----------
    options : ReplayOptions
        Topics of transforms and odometry, and transforms that the bag lacks.

    Raises
    ------
    BagError
        The bag is damaged or without transforms, a topic is none of a sensor, there are too many points, or none.
    """
    topics = choose_topics(bag.types, options.topics, (), takes_any=True)
    check_transforms(bag, topics, options.transforms, options.odometry_as_transform)
    sensors = _sensors(bag, topics, chosen.topics)
    time = RecordedTime(bag, topics, chosen.frame)
    transforms = _all_transforms(bag, topics, time, options)
    parts, total, left_out = list[FloatArray](), 0, Counter[str]()
    seen = Counter[str]()
    for recorded in bag.messages():
        if recorded.topic not in sensors:
            continue
        seen[recorded.topic] += 1
        if (seen[recorded.topic] - 1) % chosen.every:
            continue
        try:
            scan = _scan(bag, recorded, time, sensors[recorded.topic])
            parts.append(_placed(scan, transforms, chosen))
        except (ValueError, TransformError) as error:
            left_out[f"{recorded.topic}: {reason_of(error)}"] += 1
            continue
        total += len(parts[-1])
        if total > max_points:
            raise BagError(f"{bag.path}: more than {max_points} points; take fewer by --every or --max-range")
    if not total:
        reasons = "; ".join(f"{reason} ({count} times)" for reason, count in left_out.most_common(3))
        raise BagError(
            f"{bag.path}: no point could be placed in the frame {chosen.frame!r}: {reasons or 'the scans hit nothing'}"
        )
    return RecordedPoints(np.concatenate(parts), len(parts), left_out)


def write_points(file: Path, points: FloatArray, frame: str) -> None:
    """Write points (n, 3) [m] as a binary PLY; a file of that name is replaced when the new one is complete.

    The header is lines of ASCII: other characters of the frame's name are written as Python escapes them.
    """
    name = frame.encode("unicode_escape").decode("ascii")
    header = HEADER.format(frame=name, count=len(points)).encode("ascii")
    write_whole(file, header + points.astype("<f8").tobytes())


def _sensors(bag: Bag, topics: BagTopics, wanted: tuple[str, ...]) -> dict[str, str]:
    """Kinds of the sensors whose points are taken, by topic."""
    kinds = {topic: kind for topic, (kind, _) in topics.sensors.items()}
    listed = ", ".join(sorted(kinds)) or "none"
    if unknown := [topic for topic in wanted if topic not in kinds]:
        raise BagError(f"{bag.path}: --points: expected topics of range sensors ({listed}), got {unknown[0]!r}")
    clouds = {topic for topic, kind in kinds.items() if kind == CLOUDS}
    taken = {topic: kinds[topic] for topic in wanted or sorted(clouds or kinds)}
    if not taken:
        raise BagError(f"{bag.path}: expected a topic of a range sensor, got {', '.join(sorted(bag.types))}")
    for topic in taken:
        bag.require(topic)
    return taken


def _all_transforms(bag: Bag, topics: BagTopics, time: RecordedTime, options: ReplayOptions) -> TransformBuffer:
    """A buffer of all transforms of the bag."""
    buffer = TransformBuffer(cache_time=np.inf)
    for transform in options.transforms:
        buffer.set(transform)
    for recorded in steady_messages(bag):
        now = time.of_recording(recorded.time)
        try:
            for transform in _transforms_in(bag, recorded, topics, time, options, now):
                buffer.set(transform)
        except (ValueError, TransformError):
            continue  # scans that would need it are left out, and say why
    return buffer


def _transforms_in(
    bag: Bag, recorded: Recorded, topics: BagTopics, time: RecordedTime, options: ReplayOptions, now: float
) -> list[Transform]:
    if recorded.topic and recorded.topic in (topics.transforms, topics.static):
        is_static = recorded.topic == topics.static
        return list(transforms_of(bag.decode(recorded), time.context, now, static=is_static))
    if options.odometry_as_transform and recorded.topic == topics.odometry:
        message = bag.decode(recorded)
        return [odometry_transform(message, time.context, odometry_of(message, time.context, now).stamp, ROBOT_FRAME)]
    return []


def _scan(bag: Bag, recorded: Recorded, time: RecordedTime, kind: str) -> RangeScan:
    now = time.of_recording(recorded.time)
    return SENSORS[kind](bag.decode(recorded), time.context, recorded.topic, now).checked()


def _placed(scan: RangeScan, transforms: TransformBuffer, chosen: PointOptions) -> FloatArray:
    """What a scan hit (n, 3) [m], in the frame of the options."""
    hits = scan.ends[scan.hits]
    near = hits[norm(hits - scan.origin) <= chosen.max_range]
    return transforms.lookup(chosen.frame, scan.frame_id, scan.stamp).apply(near)
