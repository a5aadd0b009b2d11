"""``relax`` opens ground that is closed for the errors of a built map alone, for a time."""

import numpy as np
import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_mesh_nav.building.map_build import write_map
from mbf_mesh_nav.files.map_header import MapHeader
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CONFIGURATION = """
backend: mesh
dist_tolerance: 0.2
planner_max_retries: 0
planners: [{name: planner, type: dijkstra}]
controllers: [{name: controller, type: path_follower}]
recovery_behaviors: [{name: relax_planner, type: relax}]
relax_planner: {error_factor: 0.5, inflation_factor: 1.0, planner_tolerance: 0.0, dist_tolerance: 0.0, duration: 5.0}
mesh_map:
  mesh_file: hill.ply
  layers: [{name: border, type: border}, {name: steepness, type: steepness}]
  default_layer: steepness
  steepness: {threshold: 0.5}
"""


@pytest.fixture
def hill(tmp_path):
    """``hill(error, slope)``: a server on flat ground with a ridge across it, heights wrong by so much [m]."""
    sessions = []

    def opened(error, slope=0.4):
        x = np.arange(61) * 0.2
        heights = np.tile(np.tan(slope) * np.clip(0.6 - np.abs(x - 6.0), 0.0, None), (31, 1))
        vertices, faces = heightfield_mesh(heights, 0.2, 0.2)[:2]
        write_map(tmp_path / "hill.ply", vertices, faces, MapHeader((0.0, 0.0, 0.0), 0.02, 0.04, error))
        (tmp_path / "navigation.yaml").write_text(CONFIGURATION)
        session = LoopbackSession(Pose.planar(2.0, 3.0))
        sessions.append(session)
        session.serve(*read_config(tmp_path / "navigation.yaml"), session.robot, session.transforms)
        return session

    yield opened
    for session in sessions:
        session.close()


def plan(session):
    return session.navigator.get_path(session.navigator.ground_pose(10.0, 3.0))


def test_a_plan_leads_over_what_is_steep_by_its_error_alone_while_it_is_relaxed(hill):
    session = hill(0.05)
    assert plan(session).outcome == GetPathOutcome.NO_PATH_FOUND
    answer = session.navigator.recover("relax_planner")
    assert answer.success and "steepness at 0.5 errors" in answer.message
    assert plan(session).success
    session.clock.sleep(6.0)
    assert plan(session).outcome == GetPathOutcome.NO_PATH_FOUND


@pytest.mark.parametrize(("error", "arrives"), [(0.0, True), (0.05, True), (0.3, False)])
def test_move_base_gives_a_way_up_for_lost_only_after_the_margin_is_relaxed(hill, error, arrives):
    session = hill(error)
    result = session.navigator.go_to(session.navigator.ground_pose(10.0, 3.0))
    assert result.success == arrives, result.message


def test_what_is_too_steep_however_exact_the_map_ends_a_goal_at_once(hill):
    session = hill(0.05, slope=1.0)
    result = session.navigator.go_to(session.navigator.ground_pose(10.0, 3.0))
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND and "lethal ground of steepness separates" in result.message
    assert not any(event.source == "recovery" for event in session.memory.of_kind(EventKind.GOAL_FINISHED))
