"""Announcements of robots, and the right of way between them: one of two goes first, and never all wait for another."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.traffic.announcement import SPACING, Announcement
from mbf_abstract.traffic.right_of_way import STOREY, face_each_other, paths_conflict, right_of_way
from mbf_abstract.traffic.traffic import MAX_AGE, PARTED_AFTER, SharedChannel, Traffic

coordinates = st.floats(-20.0, 20.0, width=32)
heights = st.sampled_from([0.0, 0.25, 4.0])  # the ground, a kerb, a bridge
paths = st.lists(st.tuples(coordinates, coordinates, heights), min_size=1, max_size=8).map(np.array)
announcements = st.builds(
    Announcement,
    name=st.sampled_from(["anna", "ben", "carla", "dora", "emil"]),
    stamp=st.floats(0.0, 1e4),
    path=paths,
    remaining=st.integers(0, 3).map(float),
    cannot_yield=st.booleans(),
    waits=st.integers(0, 2),
    makes_room=st.booleans(),
    asks=st.booleans(),
    distance=st.sampled_from([0.0, 0.6, 1.0]),
)
fleets = st.lists(announcements, min_size=2, max_size=5, unique_by=lambda one: one.name)


@given(fleets)
def test_of_two_robots_exactly_one_goes_first_whoever_of_them_computes_it(fleet):
    for a, b in itertools.permutations(fleet, 2):
        as_sent = Announcement.from_json(a.to_json()), Announcement.from_json(b.to_json())
        assert right_of_way(a, b) is not right_of_way(b, a)
        assert right_of_way(*as_sent) is right_of_way(a, b)


@given(fleets)
def test_of_any_number_of_robots_exactly_one_goes_before_all_others(fleet):
    firsts = [a for a in fleet if all(right_of_way(a, b) for b in fleet if b is not a)]
    assert len(firsts) == 1


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({"name": "zoe", "cannot_yield": True, "waits": 1, "remaining": 9.0}, {"name": "ben", "remaining": 1.0}),
        ({"name": "zoe", "waits": 2, "remaining": 9.0}, {"name": "ben", "makes_room": True, "cannot_yield": True}),
        ({"name": "zoe", "remaining": 9.0}, {"name": "ben", "waits": 1, "remaining": 1.0}),
        ({"name": "zoe", "remaining": 1.0}, {"name": "ben", "remaining": 1.01}),
        ({"name": "anna", "remaining": 1.0}, {"name": "ben", "remaining": 1.0}),
    ],
    ids=[
        "one that cannot yield",
        "one that makes room comes last",
        "then the one that has waited in vain less often",
        "then the one with the shorter path",
        "then by name",
    ],
)
def test_first_goes(first, second):
    base = Announcement("", 0.0, np.zeros((1, 3)), 5.0)
    assert right_of_way(replace(base, **first), replace(base, **second))


def test_two_robots_of_one_name_are_refused():
    one = Announcement("anna", 0.0, np.zeros((1, 3)), 5.0)
    with pytest.raises(ValueError, match="'anna'"):
        right_of_way(one, one)


def naive_gap(a, b, length, storey):
    """Least distance of two paths by their corners, cut off and sampled finely, within a difference of height."""

    def points(path):
        cut, left = [path[0]], length
        for p, q in itertools.pairwise(path):
            step = math.dist(p, q)
            share = min(1.0, left / step) if step > 0.0 else 1.0
            cut += [p + s * share * (q - p) for s in np.linspace(0.0, 1.0, 200)]
            left -= share * step
            if left <= 1e-9:
                break
        return np.array(cut)

    mine, others = points(a.path), points(b.path)
    near = [others[np.abs(others[:, 2] - p[2]) <= storey] - p for p in mine]
    return min(float(np.sqrt((offsets**2).sum(axis=1)).min(initial=math.inf)) for offsets in near)


@given(announcements, announcements, st.floats(0.5, 6.0))
def test_paths_conflict_where_they_come_near_and_that_is_mutual(a, b, length):
    surely, perhaps = (naive_gap(a, b, length, STOREY + more) for more in (-2.0 * SPACING, 2.0 * SPACING))
    assert math.isinf(surely) or paths_conflict(a, b, surely + 2.0 * SPACING, length)
    assert perhaps <= 2.0 * SPACING or not paths_conflict(a, b, perhaps - 2.0 * SPACING, length)
    assert paths_conflict(a, b, 1.0, length) is paths_conflict(b, a, 1.0, length)


@given(announcements, announcements)
def test_two_robots_that_go_somewhere_face_each_other_mutually(a, b):
    assert len(a.path) == 1 or len(b.path) == 1 or face_each_other(a, b, 5.0) is face_each_other(b, a, 5.0)


def along_x(x_from, x_to):
    return Announcement("", 0.0, np.array([(x_from, 0.0, 0.0), (x_to, 0.0, 0.0)]), abs(x_to - x_from))


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (along_x(2.0, -2.0), True),
        (along_x(2.0, 1.0), True),
        (along_x(1.0, 4.0), False),
        (along_x(-1.0, 4.0), False),
        (along_x(-1.0, -4.0), False),
        (replace(along_x(1.0, 4.0), path=np.array([[1.0, 0.0, 0.0]])), True),
        (replace(along_x(-1.0, 4.0), path=np.array([[-1.0, 0.0, 0.0]])), False),
    ],
    ids=["head on", "to a goal before it", "ahead", "behind", "passed", "lets it pass", "lets it pass, behind"],
)
def test_a_robot_faces_another_one_that(other, expected):
    assert face_each_other(along_x(0.0, 4.0), other, 5.0) is expected


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"name":"a","stamp":0,"path":[],"remaining":0,"cannot_yield":false,"waits":0,"radius":0}',
        '{"name":"a","stamp":0,"path":[[0,0,0]],"remaining":0,"cannot_yield":false,"radius":0}',
        '{"name":"a","stamp":0,"path":[[0,0,0]],"remaining":0,"cannot_yield":false,"waits":0,"radius":-0.1}',
        '{"name":"a","stamp":0,"path":[[0,0,0]],"remaining":0,"cannot_yield":false,"waits":0,"radius":1e999}',
        '{"name":"a","stamp":0,"path":[[0,0,0]],"remaining":0,"cannot_yield":false,"waits":0,"radius":0,"distance":-1}',
        '{"name":"a","stamp":0,"path":[[1e200,0,0]],"remaining":0,"cannot_yield":false,"waits":0,"radius":0}',
        '{"name":"a","stamp":0,"path":[[0,0,0],[2e5,0,0]],"remaining":0,"cannot_yield":false,"waits":0,"radius":0}',
        "9" * 400,
        "null",
        pytest.param("[" * 100_000, id="nested too deeply"),
    ],
)
def test_what_is_no_announcement_is_refused(text):
    with pytest.raises(ValueError, match="no announcement"):
        Announcement.from_json(text)


def state(stamp, *places):
    return Announcement("", stamp, np.array([(x, 0.0, 0.0) for x in places]), 3.0)


def test_robots_know_what_the_others_have_announced_lately_and_not_themselves():
    channel, anna, ben = SharedChannel(), Traffic(), Traffic()
    anna.connect("anna", channel)
    ben.connect("ben", channel)
    anna.announce(state(10.0, 0.0, 3.0))
    ben.announce(state(10.5, 5.0))
    assert [one.name for one in anna.others(10.5)] == ["ben"]
    assert [one.name for one in ben.others(10.5 + MAX_AGE)] == ["anna"]  # of whom it has known since 10.5 s
    assert ben.others(10.6 + MAX_AGE) == ()


def test_a_robot_without_a_channel_announces_nothing():
    alone = Traffic()
    alone.announce(state(0.0, 1.0))
    assert (alone.own, alone.others(0.0)) == (None, ())


def test_one_that_lets_others_pass_announces_only_where_it_is():
    channel, anna = SharedChannel(), Traffic()
    anna.connect("anna", channel)
    anna.yields = True
    anna.announce(state(1.0, 0.0, 3.0))
    assert len(channel.latest()[0].path) == 1
    assert len(anna.own.path) == 2


# --------------------------------------------------------------------------------------------------- while they meet
DISTANCE, LENGTH = 0.6, 5.0


class Pair:
    """Two robots head on, and what they announce from second to second."""

    def __init__(self):
        self.channel, self.time = SharedChannel(), 0.0
        self.robots = {"anna": Traffic(), "ben": Traffic()}
        for name, traffic in self.robots.items():
            traffic.connect(name, self.channel)

    def announce(self, anna, ben):
        """Announce the ways from x to x with what remains, a second later."""
        self.time += 1.0
        for traffic, (x_from, x_to, remaining) in zip(self.robots.values(), (anna, ben), strict=True):
            way = np.array([(x_from, 0.0, 0.0), (x_to, 0.0, 0.0)])
            traffic.announce(Announcement("", self.time, way, remaining))

    def meet(self):
        """Both find that they meet; returns whom each has met."""
        met = [traffic.meet(self.time, DISTANCE, LENGTH) for traffic in self.robots.values()]
        return [[rival.name for rival in rivals] for rivals in met]

    def first(self):
        """Name of the one that goes first, which both compute."""
        anna, ben = self.channel.latest()
        assert right_of_way(anna, ben) is not right_of_way(ben, anna)
        return "anna" if right_of_way(anna, ben) else "ben"


@pytest.fixture
def pair():
    """Anna has 4 m to go, ben 5 m, and they have met."""
    made = Pair()
    made.announce((0.0, 4.0, 4.0), (2.0, -3.0, 5.0))
    assert made.meet() == [["ben"], ["anna"]]
    assert made.first() == "anna"
    return made


@pytest.mark.parametrize(("apart", "meet"), [(0.65, True), (0.75, False)])
def test_a_small_and_a_large_robot_meet_mutually_at_the_mean_of_what_both_keep(apart, meet):
    channel, keeps = SharedChannel(), {"anna": 0.4, "ben": 1.0}
    robots = {name: Traffic() for name in keeps}
    for (name, traffic), (x_from, x_to, y) in zip(robots.items(), [(0.0, 4.0, 0.0), (4.0, 0.0, apart)], strict=True):
        traffic.connect(name, channel)
        path = np.array([(x_from, y, 0.0), (x_to, y, 0.0)])
        traffic.announce(Announcement("", 1.0, path, 4.0, distance=keeps[name]))
    assert [bool(traffic.rivals(1.0, keeps[name], LENGTH)) for name, traffic in robots.items()] == [meet, meet]


def test_one_that_yields_by_driving_forward_does_not_overtake_in_rank(pair):
    pair.announce((0.0, 4.0, 4.0), (0.9, -3.0, 3.9))
    assert pair.first() == "anna"


def test_one_that_finds_a_longer_way_does_not_lose_its_rank(pair):
    pair.announce((0.0, 4.0, 40.0), (2.0, -3.0, 5.0))
    assert pair.first() == "anna"


def test_the_rank_is_kept_until_they_have_parted_for_a_while_and_then_what_remains_counts(pair):
    for _ in range(int(PARTED_AFTER)):
        pair.announce((6.0, 7.0, 4.5), (-2.0, -3.0, 1.0))
    assert pair.first() == "anna"
    pair.announce((6.0, 7.0, 4.5), (-2.0, -3.0, 1.0))
    pair.announce((6.0, 7.0, 4.5), (-2.0, -3.0, 1.0))
    assert pair.first() == "ben"


def test_one_that_could_not_yield_in_a_corridor_looks_anew_in_the_next_room(pair):
    ben = pair.robots["ben"]
    ben.set_cannot_yield(True)
    pair.announce((0.0, 4.0, 4.0), (2.0 - 0.9 * DISTANCE, -3.0, 5.0))
    assert pair.channel.latest()[1].cannot_yield
    pair.announce((0.0, 4.0, 4.0), (2.0 - 1.1 * DISTANCE, -3.0, 5.0))
    assert not pair.channel.latest()[1].cannot_yield


@pytest.mark.parametrize(("end", "remaining"), [(4.4, 4.0), (40.0, 30.0)], ids=["replanned", "another goal"])
def test_what_remained_is_announced_for_one_goal_only(pair, end, remaining):
    for time, x in ((2.0, 4.0), (3.0, end)):
        way = np.array([(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)])
        pair.robots["anna"].announce(Announcement("", time, way, 30.0), np.array([x, 0.0, 0.0]))
    assert pair.channel.latest()[0].remaining == remaining


def test_a_robot_that_has_arrived_announces_that_nothing_remains(pair):
    pair.announce((0.0, 0.0, 0.0), (2.0, -3.0, 5.0))
    assert pair.channel.latest()[0].remaining == 0.0


def test_robots_that_wait_in_vain_let_each_other_go_first_by_turns(pair):
    order = []
    for _ in range(4):
        order.append(pair.first())
        first = pair.robots[order[-1]]
        first.wait_was_in_vain(first.meet(pair.time, DISTANCE, LENGTH))
    assert order == ["anna", "ben", "anna", "ben"]


def test_one_that_cannot_yield_goes_first_until_it_has_waited_in_vain(pair):
    ben = pair.robots["ben"]
    ben.set_cannot_yield(True)
    pair.announce((0.0, 4.0, 4.0), (2.0, -3.0, 5.0))
    assert pair.first() == "ben"
    ben.wait_was_in_vain(ben.meet(pair.time, DISTANCE, LENGTH))
    assert pair.first() == "anna"


def test_one_that_meets_nobody_announces_no_trouble():
    alone = Pair()
    alone.announce((0.0, 4.0, 4.0), (2.0, 9.0, 5.0))
    alone.robots["anna"].set_cannot_yield(True)
    alone.robots["anna"].wait_was_in_vain(())
    anna = alone.channel.latest()[0]
    assert (anna.cannot_yield, anna.waits) == (False, 0)
