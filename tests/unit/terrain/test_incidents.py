"""Incidents are counted once per occurrence, after they have held long enough."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.tilt import tilt_of
from terrain.physics.incidents import IncidentKind, IncidentMonitor, roll_pitch
from terrain.physics.motion_sample import MotionSample, Thing


def rolled(angle: float, stamp: float = 0.0, x: float = 0.0) -> Pose:
    return Pose((x, 0.0, 0.0), (math.sin(angle / 2), 0.0, 0.0, math.cos(angle / 2)), stamp=stamp)


def feed(monitor: IncidentMonitor, seconds: float, start: float = 0.0, **fields: object) -> list[IncidentKind]:
    defaults = {"velocity": Twist(), "commanded": Twist(), "rolling": Twist()}
    kinds = []
    for step in range(round(seconds / 0.05)):
        sample = MotionSample(**{"pose": rolled(0.0, start + 0.05 * step), **defaults, **fields})  # type: ignore[arg-type]
        kinds += [incident.kind for incident in monitor.update(sample)]
    return kinds


def test_tilt_roll_and_pitch() -> None:
    assert tilt_of(rolled(0.3)) == pytest.approx(0.3)
    assert roll_pitch(rolled(-0.3)) == pytest.approx((-0.3, 0.0))
    nose_down = Pose((0.0, 0.0, 0.0), (0.0, math.sin(0.2), 0.0, math.cos(0.2)))
    assert roll_pitch(nose_down) == pytest.approx((0.0, 0.4))


def test_tipping_over_counts_once_while_it_lasts() -> None:
    monitor = IncidentMonitor()
    for step in range(40):
        still = Twist()
        monitor.update(MotionSample(rolled(1.3, 0.05 * step), still, still, still))
    assert monitor.counts[IncidentKind.TIPPED_OVER] == 1 and monitor.max_roll == pytest.approx(1.3)


def test_a_short_slip_is_forgiven_a_long_one_counts() -> None:
    monitor = IncidentMonitor()
    asked = Twist.planar(0.8)
    sliding = {"velocity": Twist.planar(0.4), "rolling": asked}
    assert feed(monitor, 0.4, **sliding) == []
    assert feed(monitor, 1.0, 0.4, velocity=asked, rolling=asked) == []
    assert feed(monitor, 1.0, 1.4, **sliding) == [IncidentKind.SLIPPING]
    assert feed(monitor, 1.0, 3.4, velocity=asked, rolling=asked) == []
    assert feed(monitor, 1.0, 4.4, **sliding) == [IncidentKind.SLIPPING]


def test_stuck_needs_a_command_and_high_centred_needs_ground_contact() -> None:
    monitor = IncidentMonitor()
    assert feed(monitor, 10.0) == []
    driven = {"commanded": Twist.planar(0.5)}
    assert feed(monitor, 4.0, 10.0, **driven) == [IncidentKind.STUCK]
    monitor = IncidentMonitor()
    kinds = feed(monitor, 2.0, body_on_ground=True, **driven)
    assert kinds == [IncidentKind.HIGH_CENTRED]


def test_turning_on_the_spot_and_slow_driving_are_not_stuck_but_twitching_is() -> None:
    def kinds(pose_at: Callable[[float], Pose], commanded: Twist) -> list[IncidentKind]:
        monitor, found = IncidentMonitor(), []
        for stamp in np.arange(0.0, 8.0, 0.05).tolist():
            sample = MotionSample(pose_at(stamp).stamped(stamp), Twist(), commanded, Twist())
            found += [incident.kind for incident in monitor.update(sample)]
        return found

    assert kinds(lambda t: Pose.planar(0.0, 0.0, 0.2 * t), Twist.planar(0.0, 0.0, 0.3)) == []
    assert kinds(lambda t: Pose.planar(0.06 * t, 0.0), Twist.planar(0.06)) == []
    assert kinds(lambda t: Pose.planar(0.01 * math.sin(9.0 * t), 0.0), Twist.planar(0.5)) == [IncidentKind.STUCK]


@pytest.mark.parametrize("thing", Thing)
def test_a_collision_counts_at_once_and_by_what_was_hit(thing: Thing) -> None:
    kinds = feed(IncidentMonitor(), 0.05, touched=frozenset({thing}))
    assert [kind.value for kind in kinds] == ["collision", f"collision_with_{thing.value}"]


def test_a_person_that_is_hit_while_a_wall_is_touched_counts_too() -> None:
    monitor = IncidentMonitor()
    feed(monitor, 0.2, touched=frozenset({Thing.WALL}))
    kinds = feed(monitor, 0.2, 0.2, touched=frozenset({Thing.WALL, Thing.PERSON}))
    assert kinds == [IncidentKind.COLLISION_WITH_PERSON]


def test_distance_slip_and_energy_add_up() -> None:
    monitor = IncidentMonitor()
    for step in range(21):
        pose = rolled(0.0, 0.05 * step, x=0.02 * step)
        asked = Twist.planar(0.5)
        monitor.update(MotionSample(pose, Twist.planar(0.4), asked, asked, power=30.0))
    assert monitor.distance == pytest.approx(0.4)
    assert monitor.slipped == pytest.approx(0.1) and monitor.energy == pytest.approx(30.0)


PERSON = {"touched": frozenset({Thing.PERSON})}
DRIVEN = {"commanded": Twist.planar(0.3), "rolling": Twist.planar(0.3)}


def contacts_while_moving(*phases: dict[str, object]) -> int:
    monitor = IncidentMonitor()
    for number, phase in enumerate(phases):
        feed(monitor, 0.2, 0.2 * number, **phase)
    return monitor.counts[IncidentKind.COLLISION_WHILE_MOVING]


@pytest.mark.parametrize(
    "phases",
    [
        (DRIVEN, PERSON | DRIVEN),
        ({}, PERSON, PERSON | {"commanded": Twist.planar(wz=0.3)}),
        ({"rolling": Twist.planar(0.3)}, PERSON),
        (PERSON | DRIVEN, PERSON, PERSON | DRIVEN),
    ],
    ids=["drives into it", "turns in contact", "still rolls when it touches", "goes, stands and goes in one contact"],
)
def test_a_contact_in_which_the_robot_moves_counts_once(phases: tuple[dict[str, object], ...]) -> None:
    assert contacts_while_moving(*phases) == 1


@pytest.mark.parametrize(
    "phases",
    [({}, PERSON), ({}, PERSON, PERSON | {"rolling": Twist.planar(0.4), "velocity": Twist.planar(0.4)}), (DRIVEN, {})],
    ids=["walked into", "pushed along", "no contact"],
)
def test_a_standing_robot_that_is_touched_or_pushed_has_not_moved(phases: tuple[dict[str, object], ...]) -> None:
    assert contacts_while_moving(*phases) == 0


ROLLING = {"rolling": Twist.planar(0.3)}


def test_wheels_that_roll_on_from_a_push_are_no_motion_in_the_next_contact() -> None:
    assert contacts_while_moving({}, PERSON | ROLLING, ROLLING, PERSON | ROLLING) == 0


def test_wheels_that_grip_while_a_pushed_robot_slides_are_no_motion_in_the_next_contact() -> None:
    slides = {"velocity": Twist.planar(0.3, 0.1)}
    assert contacts_while_moving({}, PERSON | slides, slides, slides | ROLLING, PERSON) == 0


@pytest.mark.parametrize("between", [{}, DRIVEN], ids=["stood", "was told to drive"])
def test_wheels_that_roll_after_a_push_count_again_once_the_robot(between: dict[str, object]) -> None:
    assert contacts_while_moving({}, PERSON | ROLLING, between, ROLLING, PERSON) == 1


def test_wheels_that_roll_on_from_a_drive_into_somebody_are_motion() -> None:
    assert contacts_while_moving(DRIVEN, PERSON | DRIVEN, ROLLING, PERSON) == 2


def test_each_new_contact_counts() -> None:
    assert contacts_while_moving(PERSON | DRIVEN, DRIVEN, PERSON | DRIVEN) == 2
