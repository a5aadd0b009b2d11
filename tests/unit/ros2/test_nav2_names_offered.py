"""Nav2's names are offered where nav2_msgs is installed, or as chosen."""

import importlib
from types import SimpleNamespace

import pytest

from mbf_ros.ros2.nav2 import DISCOVERY_TIME, is_offered, offers_names
from mbf_ros.ros2.options import NodeOptions
from mbf_ros.ros2.running import RosError


class SteppedClock:
    """Time that passes while somebody sleeps."""

    time = 0.0

    def now(self):
        return self.time

    def sleep(self, seconds):
        self.time += seconds


def test_nav2s_names_are_offered_where_nav2_msgs_is_installed(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.path", [str(tmp_path)])
    assert not is_offered(None)
    (tmp_path / "nav2_msgs").mkdir()
    (tmp_path / "nav2_msgs" / "__init__.py").touch()
    importlib.invalidate_caches()
    assert is_offered(None)


def test_a_choice_is_followed_whatever_is_installed():
    assert is_offered(True)
    assert not is_offered(False)


def test_answering_for_amcl_offers_them_and_contradicts_leaving_them_out():
    assert NodeOptions().nav2 is None
    assert NodeOptions(stands_for_amcl=True).nav2 is True
    with pytest.raises(ValueError, match="--amcl answers clients of Nav2, and --no-nav2 leaves out"):
        NodeOptions(nav2=False, stands_for_amcl=True)


class Neighbourhood:
    """What a node of rclpy sees of others: who publishes the feedback of an action, from a time on."""

    def __init__(self, clock, served, since=0.0):
        self.clock, self.served, self.since, self.warnings = clock, served, since, []

    def get_publishers_info_by_topic(self, topic):
        seen = self.clock.now() >= self.since and topic == f"{self.served}/_action/feedback"
        return [topic] if seen else []

    def get_logger(self):
        return SimpleNamespace(warning=self.warnings.append)


@pytest.fixture
def installed(monkeypatch):
    monkeypatch.setattr("mbf_ros.ros2.nav2.find_spec", lambda name: name)


@pytest.mark.parametrize("name", ["navigate_to_pose", "spin"])
def test_names_that_another_node_serves_are_left_out_with_a_warning(installed, name):
    clock = SteppedClock()
    node = Neighbourhood(clock, name, since=1.0)
    assert not offers_names(node, None, clock)
    assert node.warnings == [f"Nav2's names are left out: another node serves {name} already"]


def test_names_that_are_chosen_and_served_by_another_node_are_an_error(installed):
    clock = SteppedClock()
    with pytest.raises(RosError, match="another node serves navigate_to_pose already; end that node, or leave out"):
        offers_names(Neighbourhood(clock, "navigate_to_pose"), True, clock)


def test_names_that_nobody_serves_are_offered_once_others_would_be_known(installed):
    clock = SteppedClock()
    assert offers_names(Neighbourhood(clock, ""), None, clock)
    assert clock.now() >= DISCOVERY_TIME
    assert not offers_names(Neighbourhood(clock, ""), False, clock)
