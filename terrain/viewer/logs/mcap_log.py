"""A run as an MCAP file, for Foxglove, Lichtblick, PlotJuggler and everything else that reads MCAP.

Topics and schemas: ``terrain.viewer.logs.run_messages``. The file contains its schemas, so a reader needs no part of
this package. Use ``terrain.viewer.replay`` to look at a run without installing anything.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from mbf_abstract.whole_files import replacing
from terrain.recording.recording import Recording
from terrain.viewer.logs.foxglove_messages import nanoseconds
from terrain.viewer.logs.run_messages import JsonMessage, messages_of


def write_mcap(file: str | Path, recording: Recording) -> None:
    """Write a recording, facts of the run as metadata ``run``; the same recording gives the same bytes."""
    with replacing(file) as part, part.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="mbf-flex")
        verdict = {"verdict": str(recording.verdict), "level": recording.verdict.level.value}
        facts = {"scenario": recording.scenario, "backend": recording.backend, "robot": recording.robot.name}
        writer.add_metadata("run", facts | verdict)
        channels: dict[str, int] = {}
        for time, topic, message in messages_of(recording):
            if topic not in channels:
                channels[topic] = _add_channel(writer, topic, message)
            stamp = nanoseconds(time)
            writer.add_message(channels[topic], stamp, _bytes_of(message), stamp)
        writer.finish()


def _add_channel(writer: Writer, topic: str, message: Any) -> int:
    """Announce a topic with the schema of its first message; all that follow have the same."""
    if isinstance(message, JsonMessage):
        schema = writer.register_schema(message.schema, "jsonschema", json.dumps(message.json_schema()).encode())
        return int(writer.register_channel(topic, "json", schema))
    return int(writer.register_channel(topic, "protobuf", register_schema(writer, type(message))))


def _bytes_of(message: Any) -> bytes:
    if isinstance(message, JsonMessage):
        return json.dumps(message.values, sort_keys=True, allow_nan=False).encode()
    return bytes(message.SerializeToString(deterministic=True))
