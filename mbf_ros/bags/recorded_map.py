"""A recorded map (nav_msgs/OccupancyGrid) as a file of map_server, which configurations, plans and scenarios read."""

from __future__ import annotations

import json
import math
from pathlib import Path

from mbf_abstract.whole_files import write_whole
from mbf_ros.bags.reading import Bag, BagError
from mbf_ros.bags.recorded_time import check_end, check_seconds
from mbf_ros.messages.floors import floor_of
from mbf_ros.messages.geometry import NANOSECONDS, MessageContext
from mbf_ros.messages.interfaces import Message, MessageError

MAP_TYPE = "nav_msgs/msg/OccupancyGrid"
YAML = """\
image: {image}
mode: raw  # pixels are occupancies: 0 free to 100 occupied, 255 unknown
resolution: {resolution!r}
origin: [{x!r}, {y!r}, {yaw!r}]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def map_topic(bag: Bag, chosen: str) -> str:
    """Return the topic of the map: the chosen one, the only one of its type, or the only one that is named ``map``.

    Raises
    ------
    BagError
        There is none, it is of another type, or several come into question.
    """
    maps = sorted(topic for topic, kind in bag.types.items() if kind == MAP_TYPE)
    named = [topic for topic in maps if topic.rsplit("/", 1)[-1] == "map"]
    listed = ", ".join(maps) or "none"
    if chosen:
        if chosen not in maps:
            raise BagError(f"{bag.path}: --topic: expected a topic of the type {MAP_TYPE} ({listed}), got {chosen!r}")
        return chosen
    if len(maps) != 1 and len(named) != 1:
        advice = "; choose by --topic" if maps else ""
        raise BagError(f"{bag.path}: expected one topic of the type {MAP_TYPE}, got {listed}{advice}")
    return maps[0] if len(maps) == 1 else named[0]


def read_recorded_map(bag: Bag, topic: str, at: float) -> Message:
    """Return the last map that had been recorded ``at`` seconds after the beginning.

    Raises
    ------
    BagError
        There is none, or its bytes are none of its type.
    ValueError
        ``at`` is negative, NaN or after the end of the bag.
    """
    check_seconds("--at", at)
    check_end("--at", at, bag)
    bag.require(topic)
    last = None
    for recorded in bag.messages():
        if (recorded.time - bag.start) / NANOSECONDS > at:
            break
        if recorded.topic == topic:
            last = recorded
    if last is None:
        when = f" in the first {at:g} s" if math.isfinite(at) else ""
        raise BagError(f"{bag.path}: expected a map on {topic}{when}, got none")
    try:
        return bag.decode(last)
    except MessageError as error:
        raise BagError(f"{bag.path}: {topic}: {error}") from error


def write_recorded_map(file: Path, message: Message) -> None:
    """Write a map as ``file``, a YAML file, and an image beside it with all occupancies as they are.

    Raises
    ------
    BagError
        A file is there already, or the map has no cells, not as many as its size says, or a resolution or origin that
        means nothing.
    """
    image = file.with_suffix(".pgm")
    if there := [one for one in (file, image) if one.exists()]:
        raise BagError(f"{there[0]}: expected a file that does not exist yet, got one that exists")
    try:
        floor = floor_of(message, MessageContext())
    except MessageError as error:
        raise BagError(f"the recorded map: {error}") from error
    height, width = floor.occupancy.shape
    rows = floor.occupancy[::-1]
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(image, b"P5\n%d %d\n255\n" % (width, height) + rows.tobytes())
    name = json.dumps(image.name, ensure_ascii=False)  # quoted as in YAML: it may have a colon
    place = {"x": floor.origin_x, "y": floor.origin_y, "yaw": floor.yaw}
    write_whole(file, YAML.format(image=name, resolution=floor.resolution, **place))
