"""A goal is abandoned when none of those is there any more who listened to its feedback when it came."""

import hypothesis.strategies as st
from hypothesis import given

from mbf_ros.ros2.clients import GoalClients

listeners = st.frozensets(st.sampled_from([b"a", b"b", b"c"]))


def watched(first, *later):
    """What is abandoned at each later look, of a goal that came at the first one."""
    looks = iter([first, *later])
    clients = GoalClients(lambda: next(looks))
    clients.welcome(b"goal")
    return [clients.abandoned([b"goal"]) for _ in later]


def test_a_goal_is_abandoned_when_its_only_client_is_gone_though_another_one_came():
    assert watched({b"a"}, {b"a"}, {b"a", b"b"}, {b"b"}) == [[], [], [b"goal"]]


def test_a_goal_that_came_before_its_client_was_seen_belongs_to_the_first_ones_seen():
    assert watched(frozenset(), frozenset(), {b"a"}, {b"b"}) == [[], [], [b"goal"]]


def test_goals_that_have_ended_are_asked_for_no_more():
    looks = iter([frozenset({b"a"}), frozenset()])
    clients = GoalClients(lambda: next(looks))
    clients.welcome(b"goal")
    assert clients.abandoned([]) == []  # without a look
    assert clients.abandoned([b"goal"]) == []  # a goal of the same name is another one


@given(st.lists(listeners, min_size=2, max_size=8))
def test_it_is_what_a_search_through_all_looks_finds(looks):
    found = watched(*looks)
    for number, present in enumerate(looks[1:], 1):
        mine = next((one for one in looks[: number + 1] if one), frozenset())
        assert bool(found[number - 1]) == (bool(mine) and not mine & present)
