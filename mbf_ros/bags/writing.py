"""A bag of ROS 2 (a folder with an mcap file), written from messages by field name."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from mbf_ros.bags.reading import NEEDS, BagError
from mbf_ros.messages.interfaces import Message, completed, full_name

LAYOUT = 8  # of the metadata: what Humble and all later distributions read


class BagMessage(NamedTuple):
    """One message to be written.

    Attributes
    ----------
    time : int
        ROS time [ns].
    latched : bool
        Whether late subscribers get the last one; the same for all messages of a topic.
    """

    time: int
    topic: str
    type: str
    message: Message
    latched: bool = False


def write_bag(folder: Path, messages: Iterable[BagMessage]) -> dict[str, int]:
    """Write messages in the given order; the same messages give the same bytes, and an error leaves no bag.

    Returns
    -------
    counts : dict of str to int
        Messages by topic.

    Raises
    ------
    BagError
        The folder exists, or cannot be written.
    RuntimeError
        The package rosbags is not installed.
    """
    counts: dict[str, int] = {}
    with _writer(folder) as (writer, store):
        connections: dict[str, Any] = {}
        for one in messages:
            name = full_name(one.type)
            if one.topic not in connections:
                quality = [_quality(one.latched)]
                connections[one.topic] = writer.add_connection(
                    one.topic, name, typestore=store, offered_qos_profiles=quality
                )
            content = store.serialize_cdr(message_object(store, name, completed(name, one.message)), name)
            writer.write(connections[one.topic], one.time, content)
            counts[one.topic] = counts.get(one.topic, 0) + 1
    return counts


def message_object(store: Any, type_name: str, values: Message) -> Any:
    """Return a message of rosbags; fields that only ROS 1 has are zero.

    Parameters
    ----------
    store : Typestore
        Of rosbags.
    type_name : str
        ``package/msg/Name``
    values : dict
        By field name, complete.
    """
    described = dict(store.fielddefs[type_name][1])
    names = [field.name for field in fields(store.types[type_name]) if field.name in described]
    return store.types[type_name](*[_value(store, described[name], values.get(name, 0)) for name in names])


def _value(store: Any, described: Any, value: Any) -> Any:
    """The value of a field; its description is (kind, what), see ``rosbags.interfaces.Nodetype``."""
    from rosbags.interfaces import Nodetype

    kind, what = described
    if kind == Nodetype.NAME:
        return message_object(store, what, value)
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) and what[0][0] == Nodetype.NAME:
        return [message_object(store, what[0][1], one) for one in value]
    return value


@contextmanager
def _writer(folder: Path) -> Iterator[tuple[Any, Any]]:
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise RuntimeError(f"{NEEDS} ({error})") from error
    if folder.exists():
        raise BagError(f"{folder}: expected a folder that does not exist yet, got one that exists")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{folder.name}.", suffix=".part", dir=folder.parent) as part:
            whole = Path(part) / folder.name  # files of a bag are named after its folder
            with Writer(whole, version=LAYOUT, storage_plugin=StoragePlugin.MCAP) as writer:
                yield writer, get_typestore(Stores.ROS2_HUMBLE)
            os.replace(whole, folder)
    except (OSError, WriterError) as error:
        raise BagError(f"{folder}: the bag cannot be written: {error}") from error


def _quality(latched: bool) -> Any:
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
    unlimited = QosTime(9223372036, 854775807)
    return Qos(
        QosHistory.KEEP_LAST,
        1 if latched else 10,
        QosReliability.RELIABLE,
        durability,
        unlimited,
        unlimited,
        QosLiveliness.AUTOMATIC,
        unlimited,
        avoid_ros_namespace_conventions=False,
    )
