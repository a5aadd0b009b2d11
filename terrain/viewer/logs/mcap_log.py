"""A run as an MCAP file, for Foxglove, Lichtblick, PlotJuggler and everything else that reads MCAP.

Topics and schemas: ``terrain.viewer.logs.run_messages``. The file contains its schemas, so a reader needs no part of
this package. Use ``terrain.viewer.replay`` to look at a run without installing anything.
"""

from __future__ import annotations

from pathlib import Path

from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from mbf_abstract.whole_files import replacing
from terrain.recording.recording import Recording
from terrain.viewer.logs.foxglove_messages import nanoseconds
from terrain.viewer.logs.run_messages import TOPICS, bytes_of, json_schema, messages_of


def write_mcap(file: str | Path, recording: Recording) -> None:
    """Write a recording, facts of the run as metadata ``run``; the same recording gives the same bytes."""
    with replacing(file) as part, part.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="mbf-flex")
        verdict = {"verdict": str(recording.verdict), "level": recording.verdict.level.value}
        facts = {"scenario": recording.scenario, "backend": recording.backend, "robot": recording.robot.name}
        writer.add_metadata("run", facts | verdict)
        channels: dict[str, int] = {}
        for one in messages_of(recording):
            if one.topic not in channels:
                channels[one.topic] = _add_channel(writer, one.topic)
            stamp = nanoseconds(one.time)
            writer.add_message(channels[one.topic], stamp, bytes_of(one.make()), stamp)
        writer.finish()


def _add_channel(writer: Writer, topic: str) -> int:
    """Announce a topic with its schema."""
    schema = TOPICS[topic]
    if isinstance(schema, str):
        number = writer.register_schema(schema, "jsonschema", json_schema(schema).encode())
        return int(writer.register_channel(topic, "json", number))
    return int(writer.register_channel(topic, "protobuf", register_schema(writer, schema)))
