"""Who touched a robot that stands and is lost by its sensor: it does not set off into them, on both maps."""

from dataclasses import replace

import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.tracking.lost_contacts import LostContacts
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox

PERIOD = 0.1
HERE = Pose.planar(5.0, 1.0)
FORWARD = Twist.planar(0.3)


def shares(hall, seconds, *places):
    """What the guard allows of a command, scan by scan, while people stand at places; empty ones are nobody."""
    found = []
    for _ in range(round(seconds / PERIOD)):
        hall.sees(*places)
        found.append(hall.map.safe_share(HERE, Twist(), FORWARD, hall.now))
    return found


def comes(hall, until):
    """Somebody walks towards the robot, as far as ``until`` [m] along y."""
    y = 3.0
    while y > until:
        y -= 0.6 * PERIOD
        hall.sees((5.0, y))
        hall.map.safe_share(HERE, Twist(), FORWARD, hall.now)
    return y


def test_a_robot_stands_while_who_touched_it_is_out_of_sight(hall):
    comes(hall, until=1.4)
    found = shares(hall, 2.9)
    assert {share for share, _, _ in found} == {0.0}
    assert "came as near as a contact and is out of sight" in found[-1][1] and found[-1][2] == 10.0
    assert shares(hall, 0.3)[-1][0] == 1.0, "not for ever"


def test_who_was_lost_farther_away_holds_nobody(hall):
    comes(hall, until=2.2)
    assert shares(hall, 1.1)[-1][0] == 1.0


def test_who_is_seen_to_leave_holds_nobody(hall):
    y = comes(hall, until=1.4)
    for _ in range(20):
        y += 0.6 * PERIOD
        hall.sees((5.0, y))
        hall.map.safe_share(HERE, Twist(), FORWARD, hall.now)
    assert shares(hall, 1.1)[-1][0] == 1.0


def test_a_command_to_stand_is_no_wait(hall):
    comes(hall, until=1.4)
    shares(hall, 0.5)
    assert hall.map.safe_share(HERE, Twist(), Twist(), hall.now)[0] == 1.0


def test_without_the_time_the_robot_sets_off_when_they_are_forgotten(make_hall):
    hall = make_hall(lost_contact_time=0.0)
    comes(hall, until=1.4)
    assert shares(hall, 1.3)[-1][0] == 1.0


BOX, AT = RobotBox.disc(0.3), Pose.planar(0.0, 0.0)
NEAR = TrackedObject(1, Motion.MOVING, 0.5, 0.0, 0.0, -0.4, 0.0, 0.2, 5.0, 0.0, 0.0, 0.0, "map")


def held(contacts, now, *moving):
    return contacts.held(BOX, AT, moving, 0.1, 3.0, now)


@pytest.mark.parametrize("unseen", [0.3, 0.9])
def test_a_track_that_goes_on_by_itself_has_not_left(unseen):
    """Its last look may have shown a part of somebody, and a velocity that is none."""
    contacts = LostContacts()
    assert held(contacts, 0.0, NEAR) is None, "who is seen is the business of the guard"
    later = replace(NEAR, x=0.5 + unseen, vx=1.0, unseen=unseen)
    assert held(contacts, unseen, later).number == 1


def test_it_is_named_where_it_was_last_seen():
    contacts = LostContacts()
    held(contacts, 0.1, replace(NEAR, x=0.45, unseen=0.1))
    found = held(contacts, 1.0)
    assert (found.x, found.stamp) == (pytest.approx(0.49), pytest.approx(0.0))


def test_nothing_is_remembered_of_who_left_or_was_out_of_sight_for_long():
    contacts = LostContacts()
    held(contacts, 0.0, NEAR, replace(NEAR, number=2))
    held(contacts, 0.4, replace(NEAR, x=1.5))
    assert held(contacts, 0.5, replace(NEAR, x=1.6)).number == 2
    assert held(contacts, 3.0) is None
    assert not contacts._near and not contacts._last_seen
