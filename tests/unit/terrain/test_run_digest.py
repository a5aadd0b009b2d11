"""The digest of a run: every bit of every pose, command and event counts, the same on every machine."""

import math

import pytest

from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import AckermannCommand, Pose, Twist
from terrain.recording.run_digest import RunDigest


def digest_of(*entries, time=0.5):
    """The digest of poses, commands and events in this order."""
    digest = RunDigest(lambda: time)
    for entry in entries:
        if isinstance(entry, Pose):
            digest.pose(entry)
        elif isinstance(entry, Event):
            digest.write(entry)
        else:
            digest.command(entry)
    return digest.hexdigest()


POSE = Pose((1.0, 2.0, 0.25))
COMMAND = Twist.planar(0.5, wz=-0.1)
EVENT = Event(1.5, EventKind.FAULT, "robot", {"message": "caf\u00e9"})


def test_it_is_the_same_number_on_every_machine():
    """Computed by hand: letter, count of numbers, stamp and numbers of eight bytes each; events as lines."""
    assert digest_of(POSE, COMMAND, EVENT) == "358a1ca3bea6bf5ec663b19fa2f47d009c6c7de18928c27109e0b81eef355844"


@pytest.mark.parametrize(
    "other",
    [
        (POSE, Twist.planar(math.nextafter(0.5, 1.0), wz=-0.1), EVENT),
        (Pose((1.0, 2.0, math.nextafter(0.25, 0.0))), COMMAND, EVENT),
        (Pose((1.0, 2.0, 0.25), (0.0, 0.0, math.sin(5e-9), 1.0)), COMMAND, EVENT),
        (POSE, COMMAND, Event(1.5, EventKind.FAULT, "robot", {"message": "cafe"})),
        (COMMAND, POSE, EVENT),
        (POSE, COMMAND),
        (POSE, AckermannCommand(0.5, -0.1), EVENT),
        (POSE, Twist.planar(0.5, 0.0, -0.1), EVENT, EVENT),
    ],
    ids=["command by a bit", "pose by a bit", "orientation", "event", "order", "missing", "kind", "more"],
)
def test_whatever_differs_gives_another_digest(other):
    assert digest_of(*other) != digest_of(POSE, COMMAND, EVENT)


def test_the_instant_counts():
    assert digest_of(POSE, time=0.5) != digest_of(POSE, time=math.nextafter(0.5, 1.0))


def test_a_zero_with_a_sign_is_another_command():
    assert digest_of(Twist.planar(0.0)) != digest_of(Twist.planar(-0.0))
