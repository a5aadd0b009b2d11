"""On every backend: a robot behind another one that stands in the only opening announces the path through there."""

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.server.announcer import Announcer
from mbf_abstract.testing.conformance.rig import Box
from mbf_abstract.testing.conformance.site import site
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.traffic import SharedChannel

GOAL = Pose.planar(7.0, 4.0)
OPENING = (3.3, 4.0)
BEN = Box(3.1, 3.8, 3.5, 4.2)
ROOM = (  # with an opening of 1 m, in its east wall
    Box(0.6, 2.6, 3.4, 2.8),
    Box(0.6, 5.2, 3.4, 5.4),
    Box(0.6, 2.6, 0.8, 5.4),
    Box(3.2, 2.6, 3.4, 3.5),
    Box(3.2, 4.5, 3.4, 5.4),
)


@pytest.fixture(params=["costmap", "mesh", "tiles"])
def anna(request, backends):
    """The site of a robot in the room; ``meets(**changes)`` puts ben into the opening and has both announce it."""
    with site(backends[request.param], planner_max_retries=0) as made:
        channel = SharedChannel()
        announcer = Announcer(made.server, "anna", channel)

        def meets(**changes):
            made.place(*ROOM, BEN)
            ben = {"radius": 0.28, "makes_room": True} | changes
            channel.publish(Announcement("ben", made.rig.clock.now(), np.array([(*OPENING, 0.0)]), 0.0, **ben))
            announcer.announce()

        made.meets, made.traffic = meets, made.server.runtime.traffic
        yield made


def leads_through_the_opening(path):
    return float(np.hypot(*(path.positions[:, :2] - OPENING).T).min()) < 0.2


def test_the_wish_leads_through_the_one_that_stands_in_the_opening_and_the_map_knows_it_again(anna):
    for _ in range(2):
        anna.meets()
        result = anna.navigator.get_path(GOAL)
        assert not result.success and result.path is None
        assert leads_through_the_opening(anna.traffic.wished)
    anna.place(*ROOM)
    result = anna.navigator.get_path(GOAL)
    assert result.success and leads_through_the_opening(result.path)
    assert anna.traffic.wished is None


def test_one_that_has_no_place_to_make_room_leaves_the_robot_without_a_path_and_a_wish(anna):
    anna.meets(cannot_yield=True)
    assert anna.navigator.get_path(GOAL).outcome == GetPathOutcome.NO_PATH_FOUND
    assert anna.traffic.wished is None


def test_a_robot_that_is_shut_in_by_walls_wishes_for_nothing(anna):
    anna.meets()
    anna.place(*ROOM, Box(2.6, 2.6, 2.8, 5.4))
    assert not anna.navigator.get_path(GOAL).success
    assert anna.traffic.wished is None
