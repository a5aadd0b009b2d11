"""Which topic of a bag is what: chosen by its type where only one comes into question, else by the user."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from mbf_abstract.geometry.transform import Transform
from mbf_ros.bags.reading import KNOWN_AS, Bag, BagError
from mbf_ros.messages.interfaces import full_name
from mbf_ros.messages.sensors import SENSORS
from mbf_ros.robot_inputs import Input

TRANSFORMS, STATIC, ODOMETRY, MAP = "tf", "tf_static", "odom", "map"
ROLES = {TRANSFORMS: "tf2_msgs/msg/TFMessage", STATIC: "tf2_msgs/msg/TFMessage", ODOMETRY: "nav_msgs/msg/Odometry"}
SENSOR_TYPES = {kind.replace("/", "/msg/"): kind for kind in SENSORS}
USUAL_NAMES = {"scan": "sensor_msgs/LaserScan", "points": "sensor_msgs/PointCloud2", "range": "sensor_msgs/Range"}
"""Sources that are named after a type take topics of that type only."""


@dataclass(frozen=True)
class BagTopics:
    """The topics that are replayed.

    Attributes
    ----------
    transforms, static, odometry : str
        Topics; empty where there is none.
    sensors : dict of str to (str, str)
        Type of ``sensors.SENSORS``, and source of the configuration, by topic.
    maps : dict of str to Input
        What takes the maps of floors that the configuration expects, by topic.
    """

    transforms: str = ""
    static: str = ""
    odometry: str = ""
    sensors: dict[str, tuple[str, str]] = field(default_factory=dict)
    maps: dict[str, Input] = field(default_factory=dict)

    def used_as(self, topic: str) -> str:
        """What a topic is replayed as; empty for one that is not."""
        if topic in self.sensors:
            return self.sensors[topic][1]
        if topic in self.maps:
            return MAP
        roles = {self.transforms: TRANSFORMS, self.static: STATIC, self.odometry: ODOMETRY}
        return roles.get(topic, "")


def choose_topics(
    types: Mapping[str, str],
    chosen: Mapping[str, str],
    sources: Sequence[str],
    takes_any: bool,
    maps: Iterable[Input] = (),
) -> BagTopics:
    """Find the topics of a bag.

    Parameters
    ----------
    types : mapping of str to str
        Message type by topic.
    chosen : mapping of str to str
        Topics that the user has named, by ``tf``, ``tf_static``, ``odom`` or a source; empty for none.
    sources : sequence of str
        Observation sources that the configuration names.
    takes_any : bool
        Whether a layer takes scans of any source: each topic of a sensor is then a source, of its own name.
    maps : iterable of Input
        Maps of floors that the configuration expects; each is taken where the bag has it.

    Raises
    ------
    BagError
        Several topics come into question, a chosen one is not there or of another type, or it is for nothing known.
    """
    own = sorted(topic for topic, kind in types.items() if kind in SENSOR_TYPES)
    named = tuple(sources) or (tuple(topic.lstrip("/") for topic in own) if takes_any else ())
    if unknown := sorted(chosen.keys() - {*ROLES, *named}):
        known = ", ".join((*ROLES, *named))
        raise BagError(f"--topic {unknown[0]}={chosen[unknown[0]]}: expected one of {known}, got {unknown[0]!r}")
    roles = {role: _topic(role, _of_role(role, types), types, chosen) for role in ROLES}
    fitting = {source: _of_source(source, own, types) for source in named}
    if not sources:
        fitting = {source: [topic] for source, topic in zip(named, own, strict=False)}
    pairs = {source: _topic(source, fitting[source], types, chosen) for source in named}
    if twice := sorted(topic for topic in set(pairs.values()) if topic and [*pairs.values()].count(topic) > 1):
        several = [source for source, topic in pairs.items() if topic == twice[0]]
        raise BagError(f"{twice[0]} would be {' and '.join(several)}: name the topic of each by --topic SOURCE=TOPIC")
    sensors = {topic: (SENSOR_TYPES[types[topic]], source) for source, topic in pairs.items() if topic}
    floors = {f"/{one.topic.lstrip('/')}": one for one in maps}
    there = {topic: one for topic, one in floors.items() if types.get(topic) == full_name(one.type)}
    return BagTopics(roles[TRANSFORMS], roles[STATIC], roles[ODOMETRY], sensors, there)


def check_transforms(bag: Bag, topics: BagTopics, given: Sequence[Transform], odometry: bool) -> None:
    """Raise BagError where nothing says where the robot is: no topic, no ``given`` transform, and no ``odometry``."""
    if odometry and not topics.odometry:
        raise BagError(f"{bag.path}: --odom-tf: expected odometry (nav_msgs/Odometry), got none")
    if not (topics.transforms or topics.static or given or odometry):
        raise BagError(
            f"{bag.path}: expected transforms (tf2_msgs/TFMessage), got none; --odom-tf takes the poses of odometry, "
            "--tf PARENT:CHILD=X,Y,Z,YAW gives one that does not change"
        )


def _of_role(role: str, types: Mapping[str, str]) -> list[str]:
    """Topics that come into question; transforms that hold for ever are known by their name only."""
    fitting = sorted(topic for topic, kind in types.items() if KNOWN_AS.get(kind, kind) == ROLES[role])
    if role == ODOMETRY:
        return fitting
    return [topic for topic in fitting if topic.endswith(STATIC) == (role == STATIC)]


def _of_source(source: str, own: Sequence[str], types: Mapping[str, str]) -> list[str]:
    wanted = USUAL_NAMES.get(source)
    return [topic for topic in own if wanted is None or SENSOR_TYPES[types[topic]] == wanted]


def _topic(what: str, fitting: Sequence[str], types: Mapping[str, str], chosen: Mapping[str, str]) -> str:
    """The chosen topic, or the only one; empty where there is none."""
    if what not in chosen:
        if len(fitting) > 1:
            raise BagError(f"several topics may be {what!r}: {', '.join(fitting)}; choose by --topic {what}=TOPIC")
        return fitting[0] if fitting else ""
    topic = chosen[what]
    allowed = {*SENSOR_TYPES} if what not in ROLES else {kind for kind in types.values() if _is(kind, ROLES[what])}
    if topic and types.get(topic) not in allowed:
        found = f"of type {types[topic]}" if topic in types else "not in the bag"
        candidates = ", ".join(sorted(one for one, kind in types.items() if kind in allowed)) or "none"
        raise BagError(f"--topic {what}={topic}: expected one of the topics {candidates}, got one {found}")
    return topic


def _is(kind: str, wanted: str) -> bool:
    return KNOWN_AS.get(kind, kind) == wanted
