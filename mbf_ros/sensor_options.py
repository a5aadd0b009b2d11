"""The option ``--sensor`` of the commands: which topics of a robot feed which sources of the configuration.

A sensor is subscribed, and missed when it falls silent, only where a layer of a map listens to its source.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from mbf_ros.messages.sensors import SENSORS

BY_DEFAULT = ("scan", "points", "range")
"""Sources that are taken where no ``--sensor`` is given; that one of them feeds nothing is no mistake."""


def sensors_of(texts: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Return type and source by topic; raises ValueError where a text is no TOPIC:TYPE=SOURCE, or repeats a topic."""
    found: dict[str, tuple[str, str]] = {}
    for text in texts:
        topic, _, rest = text.partition(":")
        kind, _, source = rest.partition("=")
        name = f"sensor_msgs/{kind}"
        if not topic or not source or name not in SENSORS:
            kinds = ", ".join(one.partition("/")[2] for one in SENSORS)
            raise ValueError(f"--sensor: expected TOPIC:TYPE=SOURCE with one of the types {kinds}, got {text!r}")
        if topic.lstrip("/") in {other.lstrip("/") for other in found}:
            raise ValueError(f"--sensor: expected each topic once, got {topic!r} twice")
        found[topic] = (name, source)
    return found


def used_sensors(
    chosen: Mapping[str, tuple[str, str]], listens_to: Callable[[str], bool], report: Callable[[str], None]
) -> dict[str, tuple[str, str]]:
    """Return the sensors to whose source a map listens; of the others those not taken by default are reported."""
    used = {topic: one for topic, one in chosen.items() if listens_to(one[1])}
    for topic, (_, source) in chosen.items():
        if topic not in used and source not in BY_DEFAULT:
            report(f"{topic} is not used: no layer of a map listens to the source {source!r}")
    return used
