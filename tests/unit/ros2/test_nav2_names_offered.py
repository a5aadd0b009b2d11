"""Nav2's names are offered where nav2_msgs is installed, or as chosen."""

import importlib

import pytest

from mbf_ros.ros2.nav2 import is_offered
from mbf_ros.ros2.options import NodeOptions


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
