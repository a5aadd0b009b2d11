"""A goal is abandoned when none of the clients is there any more that were there when it came."""

from types import SimpleNamespace

import hypothesis.strategies as st
from hypothesis import given

from mbf_ros.ros2.clients import GoalClients, action_clients

listeners = st.frozensets(st.sampled_from([b"a", b"b", b"c"]))


def watched(first, *later):
    """What is abandoned at each later look, of a goal that came at the first one."""
    looks = iter([first, *later])
    clients = GoalClients(lambda: next(looks))
    clients.welcome(b"goal")
    return [clients.abandoned([b"goal"]) for _ in later]


def test_a_goal_is_abandoned_when_its_only_client_is_gone_though_another_one_came_later():
    assert watched({b"a"}, {b"a"}, {b"a"}, {b"a", b"b"}, {b"b"}) == [[], [], [], [b"goal"]]


def test_a_client_that_is_seen_late_keeps_its_goal_when_another_one_closes():
    assert watched({b"other"}, {b"other"}, {b"other", b"late"}, {b"late"}, set()) == [[], [], [], [b"goal"]]


def test_a_goal_that_came_before_its_client_was_seen_belongs_to_the_first_ones_seen():
    nobody = frozenset()
    assert watched(nobody, nobody, nobody, nobody, {b"a"}, {b"b"}) == [[], [], [], [], [b"goal"]]


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
        joined = frozenset().union(*looks[: min(number, 2) + 1])
        mine = joined or next((one for one in looks[: number + 1] if one), frozenset())
        assert bool(found[number - 1]) == (bool(mine) and not mine & present)


class Graph:
    """The graph as a node of rclpy shows it: who listens to the feedback of an action, and of whom services are."""

    def __init__(self, listeners, clients):
        self.listeners, self.clients = listeners, clients

    def get_subscriptions_info_by_topic(self, topic):
        assert topic == "~/move_base/_action/feedback"
        return [SimpleNamespace(endpoint_gid=gid, node_name=name, node_namespace="/") for gid, name in self.listeners]

    def get_node_names_and_namespaces(self):
        return [(name, "/") for name, _ in self.clients]

    def resolve_service_name(self, name):
        return name.replace("~", "/node")

    def get_client_names_and_types_by_node(self, name, namespace):
        return [(service, ["a type"]) for service in dict(self.clients)[name]]


def test_who_only_listens_to_feedback_is_no_client():
    goals = "/node/move_base/_action/send_goal"
    listeners = [([1], "panel"), ([2], "echo"), ([3], "_NODE_NAME_UNKNOWN_"), ([4], "twin"), ([5], "twin")]
    graph = Graph(listeners, [("panel", [goals]), ("echo", []), ("twin", []), ("twin", [goals])])
    assert action_clients(graph, "~/move_base") == {bytes([gid]) for gid in (1, 3, 4, 5)}
