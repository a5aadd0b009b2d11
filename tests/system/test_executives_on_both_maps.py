"""The executives in a simulated building: the same script drives on a costmap and on a mesh."""

import importlib.util
from pathlib import Path

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase
from terrain.session.session import Session, SessionOptions

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

pytestmark = pytest.mark.timeout(120)


@pytest.fixture
def waypoints():
    """The example script, as a module."""
    spec = importlib.util.spec_from_file_location("waypoints_state_machine", EXAMPLES / "waypoints_state_machine.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_all_legs_are_planned_first_and_the_cheap_order_is_driven(backend, waypoints, capsys, monkeypatch):
    monkeypatch.setattr(waypoints, "WAYPOINTS", [(5.0, 1.5), (4.0, 2.2)])
    assert waypoints.main("indoor", backend)
    assert "order [2, 1]" in capsys.readouterr().out  # on the way first, whatever the order of the list


@pytest.mark.parametrize("backend", ["costmap", "mesh"])
def test_the_tree_and_the_classic_machine_drive_the_same_robot(backend):
    with Session("indoor", SessionOptions(backend=backend)) as session:
        there = Pose.planar(4.5, 2.0, 0.5, session.world.height_at(4.5, 2.0))
        back = Pose.planar(3.0, 3.0, 3.0, session.world.height_at(3.0, 3.0))
        tree = TreeExecutive(navigation_tree(TreeOptions(second_planner_pause=1.0)), session.navigator)
        result = tree.run(there)
        assert result.success, result.message
        classic = ClassicMoveBase(session.navigator).run(back)
        assert classic.success, classic.message
        assert classic.dist_to_goal < 0.3
        assert not session.memory.of_kind(EventKind.FAULT)
