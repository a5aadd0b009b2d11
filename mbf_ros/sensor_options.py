"""The option ``--sensor`` of the commands: which topics of a robot feed which sources of the configuration."""

from __future__ import annotations

from collections.abc import Iterable

from mbf_ros.messages.sensors import SENSORS


def sensors_of(texts: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Return type and source by topic; raises ValueError where a text is no TOPIC:TYPE=SOURCE, or repeats a topic."""
    found: dict[str, tuple[str, str]] = {}
    for text in texts:
        topic, _, rest = text.partition(":")
        kind, _, source = rest.partition("=")
        name = f"sensor_msgs/{kind}"
        if not topic or not source or name not in SENSORS:
            kinds = ", ".join(one.partition("/")[2] for one in SENSORS)
            raise ValueError(f"--sensor must be TOPIC:TYPE=SOURCE with one of the types {kinds}, got {text!r}")
        if topic.lstrip("/") in {other.lstrip("/") for other in found}:
            raise ValueError(f"--sensor names the topic {topic} twice; each topic feeds one source")
        found[topic] = (name, source)
    return found
