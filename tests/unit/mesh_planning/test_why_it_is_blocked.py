"""What a planner says of a blocked start: which layer makes it so, by which numbers, as far as a user can act."""

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.planners.astar import AStarPlanner

RADII = {"inscribed_radius": 0.2, "inflation_radius": 0.4}


@pytest.fixture
def blocked_start(tmp_path, make_plugin):
    """``blocked_start(slope, layers, **blocks)`` -> message of a plan that begins on a slope [rad] of 6 m."""

    def make(slope, layers, **blocks):
        heights = np.tile(np.arange(31) * 0.2 * np.tan(slope), (31, 1))
        np.savez(tmp_path / "slope.npz", z=heights, dx=0.2, dy=0.2)
        entries = [MeshLayerEntry(name=name, type=kind, inputs=inputs) for name, kind, inputs in layers]
        file = str(tmp_path / "slope.npz")
        parameters = MeshMapParameters(mesh_file=file, layers=entries, default_layer=layers[-1][0])
        mesh_map = build_mesh_map(parameters, blocks)
        at = mesh_map.locate([[2.0, 3.0, 1.0]]).points[0]
        plan = make_plugin(AStarPlanner, mesh_map).make_plan(PlanRequest(Pose(tuple(at)), Pose(tuple(at + 0.1))))
        assert plan.outcome == GetPathOutcome.BLOCKED_START
        return plan.message

    return make


def test_the_layer_that_makes_it_lethal_is_named_with_its_numbers_and_not_those_that_follow(blocked_start):
    layers = [("slopes", "steepness", ()), ("around", "inflation", ("slopes",))]
    message = blocked_start(0.5, layers, slopes={"threshold": 0.3}, around=RADII)
    assert "is blocked: lethal in layer slopes (0.5 rad, threshold 0.3 rad); " in message


def test_that_an_error_of_the_heights_lowers_a_threshold_is_said(blocked_start):
    message = blocked_start(0.25, [("slopes", "steepness", ())], slopes={"threshold": 0.3, "height_error": 0.05})
    assert "slopes (0.25 rad, threshold 0.3 rad, lowered for the error of the map's heights)" in message


@pytest.mark.parametrize(("error", "text"), [(0.0, ""), (0.03, ", with an error of the heights of 0.030 m")])
def test_headings_that_tilt_allows_and_needs_are_counted(blocked_start, error, text):
    message = blocked_start(0.9, [("lean", "tilt", ())], lean={"height_error": error, "needed_headings": 0.5})
    assert f"lethal in layer lean (0 of 16 headings are allowed, 8 needed{text}); " in message
