"""Bags of ROS 1 (``.bag``) and ROS 2 (folders, ``.mcap``, ``.db3``) as messages by field name, read by rosbags.

Only messages that are asked for are decoded, so a bag may hold types that nobody knows.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from mbf_abstract.event_values import error_text
from mbf_ros.messages.interfaces import Message, MessageError, completed

NEEDS = "bags are read and written by the package rosbags: pip install 'mbf-flex[bags]'"
OLD_TRANSFORMS = "tf/msg/tfMessage"  # of ROS 1 before tf2
KNOWN_AS = {OLD_TRANSFORMS: "tf2_msgs/msg/TFMessage"}
IDL_SEPARATOR = "=" * 80 + "\n"
ROS2_FILES = (".mcap", ".db3")


class BagError(ValueError):
    """A bag cannot be read, or does not hold what is needed; the text names the bag and the reason."""


class Recorded(NamedTuple):
    """One message of a bag: its topic, when it was recorded [ns since 1970], and its bytes."""

    topic: str
    time: int
    raw: bytes


class Bag:
    """An open bag.

    Parameters
    ----------
    reader : object
        Of rosbags, open.

    Attributes
    ----------
    types : dict of str to str
        Message type by topic, ``package/msg/Name``.
    start, end : int
        When the first and the last message were recorded [ns].
    """

    def __init__(self, path: Path, reader: Any, is_ros1: bool) -> None:
        self.path, self._reader, self._is_ros1 = path, reader, is_ros1
        self.types: dict[str, str] = {one.topic: one.msgtype for one in reader.connections}
        if not reader.connections or not reader.message_count:
            raise BagError(f"{path}: the bag holds no messages")
        self.start, self.end = int(reader.start_time), int(reader.end_time)
        self._stores: dict[str, Any] = {}

    def messages(self) -> Iterator[Recorded]:
        """All messages in the order in which they were recorded.

        Raises
        ------
        BagError
            The bag is damaged.
        """
        try:
            for connection, time, raw in self._reader.messages():
                yield Recorded(connection.topic, int(time), bytes(raw))
        except Exception as error:  # whatever rosbags makes of damaged bytes
            raise BagError(f"{self.path}: the bag is damaged: {_reason(error)}") from error

    def require(self, topic: str) -> None:
        """Check that messages of a topic can be decoded; raises BagError where the definition is missing or broken."""
        self._store(topic)

    def decode(self, recorded: Recorded) -> Message:
        """Return a message by field name; raises MessageError where its bytes are none of its type."""
        kind, store = self.types[recorded.topic], self._store(recorded.topic)
        read = store.deserialize_ros1 if self._is_ros1 else store.deserialize_cdr
        try:
            values = _by_field_name(read(recorded.raw, kind), store)
        except Exception as error:  # rosbags raises of many kinds for bytes that do not fit
            raise MessageError(f"the message cannot be decoded: {_reason(error)}") from error
        return completed(KNOWN_AS.get(kind, kind), values)

    def _store(self, topic: str) -> Any:
        """Types of rosbags that decode a topic."""
        if topic not in self._stores:
            connection = next(one for one in self._reader.connections if one.topic == topic)
            try:
                self._stores[topic] = _types_of(connection)
            except Exception as error:
                reason = f"the definition of {connection.msgtype} cannot be used: {_reason(error)}"
                raise BagError(f"{self.path}: {topic}: {reason}") from error
        return self._stores[topic]


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a ``.bag`` file of ROS 1, or a folder, ``.mcap`` or ``.db3`` file of ROS 2.

    Raises
    ------
    BagError
        There is none, or it is damaged.
    RuntimeError
        The package rosbags is not installed.
    """
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
    except ImportError as error:
        raise RuntimeError(f"{NEEDS} ({error})") from error
    if not path.exists():
        raise BagError(f"{path}: expected a bag, got no such file or folder")
    is_ros1 = path.suffix == ".bag" and path.is_file()
    is_ros2 = path.is_file() and path.suffix in ROS2_FILES
    if not (is_ros1 or is_ros2 or (path / "metadata.yaml").is_file()):
        ros2 = "of ROS 2 a .mcap or .db3 file or a folder with a metadata.yaml"
        raise BagError(f"{path}: expected a .bag file of ROS 1, or {ros2}")
    if _has_compressed_files(path):
        advice = "ros2 bag convert, or zstd -d and a metadata.yaml without compression, gives one that is read"
        raise BagError(f"{path}: files that are compressed as a whole are not read; {advice}")
    reader: Any = None
    try:
        reader = (Reader1 if is_ros1 else Reader2)(path)
        reader.open()
        bag = Bag(path, reader, is_ros1)
    except BagError:
        reader.close()
        raise
    except Exception as error:  # whatever rosbags makes of damaged bytes
        advice = "; rosbag reindex may save the rest" if is_ros1 else "; ros2 bag reindex may save the rest"
        raise BagError(f"{path}: is not a bag, or is truncated: {_reason(error)}{advice}") from error
    try:
        yield bag
    finally:
        reader.close()


def _has_compressed_files(path: Path) -> bool:
    """Whether rosbags would unpack whole files into a temporary folder, however large they become."""
    try:
        content = yaml.safe_load((path / "metadata.yaml").read_text(encoding="utf-8"))
        return str(content["rosbag2_bagfile_information"]["compression_mode"]).lower() == "file"
    except Exception:  # a single file, or rosbags says what is wrong
        return False


def _types_of(connection: Any) -> Any:
    """Types of rosbags for one connection: of its own definition, or of ROS 2 where the bag holds none."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    text = connection.msgdef.data
    if connection.msgdef.format == MessageDefinitionFormat.NONE:
        store = get_typestore(Stores.LATEST)
        if connection.msgtype not in store.fielddefs:
            raise BagError("the bag holds no definition, and it is not a type of ROS 2 itself")
        return store
    store = get_typestore(Stores.EMPTY)
    if connection.msgdef.format == MessageDefinitionFormat.MSG:
        store.register(get_types_from_msg(text, connection.msgtype))
        return store
    parts = text.split(IDL_SEPARATOR)[1:] if text.startswith(f"{IDL_SEPARATOR}IDL: ") else ["\n" + text]
    types: dict[str, Any] = {}
    for part in parts:
        types.update(get_types_from_idl(part.partition("\n")[2]))
    store.register(types)
    return store


def _by_field_name(value: Any, store: Any) -> Any:
    """A message of rosbags as a dictionary by field name, all the way down; without the constants of its type."""
    if hasattr(value, "__msgtype__"):
        names = (name for name, _ in store.fielddefs[value.__msgtype__][1])
        return {name: _by_field_name(getattr(value, name), store) for name in names}
    return [_by_field_name(one, store) for one in value] if isinstance(value, list) else value


def _reason(error: Exception) -> str:
    return " ".join(error_text(error).split()).rstrip(".") or type(error).__name__
