"""A token set by another thread while a kernel runs without the interpreter lock ends the plan half-way."""

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_abstract.time.clock import WallClock
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.planners.cvp import CVPPlanner
from mbf_mesh_nav.search import wave_search

SIDE = 700


def test_a_wave_over_a_big_mesh_ends_when_another_thread_cancels_it(make_plugin, monkeypatch):
    mesh_map = MeshMap.from_heights(np.zeros((SIDE, SIDE)), 0.1, 0.1)
    planner = make_plugin(CVPPlanner, mesh_map)
    planner.make_plan(PlanRequest(Pose.planar(0.5, 0.5), Pose.planar(0.8, 0.8)))  # compiled before it counts
    fields, token = [], CancelToken()
    seeded_arrays = wave_search.seeded_arrays

    def watched_arrays(*arguments):
        arrays = seeded_arrays(*arguments)
        fields.append(arrays[0])
        return arrays

    def cancel_when_the_wave_has_left_the_goal():
        near_goal = int(mesh_map.faces[mesh_map.locate_one((1.5, 0.5, 0.0)).face, 0])
        while not fields or fields[0][near_goal] == np.inf:
            pass
        token.cancel("another thread")

    monkeypatch.setattr(wave_search, "seeded_arrays", watched_arrays)
    thread = WallClock().spawn(cancel_when_the_wave_has_left_the_goal, "canceller")
    across = PlanRequest(Pose.planar(69.0, 69.0), Pose.planar(0.5, 0.5), cancel_token=token)
    result = planner.make_plan(across)
    thread.join()
    assert (result.outcome, result.message) == (GetPathOutcome.CANCELED, "another thread")
    settled = np.count_nonzero(np.isfinite(fields[0]))
    assert 0 < settled < 0.9 * SIDE * SIDE
