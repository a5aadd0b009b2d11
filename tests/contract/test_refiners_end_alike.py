"""Refiners of every map answer the same in the same situation."""

import numpy as np
import pytest

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.testing.contract.rig import canceled_token, rig
from mbf_abstract.time.cancel import CancelToken

CORNER = Path.from_points([(1.0, 1.0, 0.0), (3.0, 1.0, 0.0), (3.0, 4.0, 0.0)], frame_id="map")
OUT_AND_BACK = Path(np.array([[1.0, 1.0, 0.0], [3.0, 1.0, 0.0], [1.0, 1.0, 0.0]]), frame_id="map")
REFINERS = {"costmap": "smoother", "mesh": "string_pulling"}


def nothing(x, y):
    return np.zeros_like(x, dtype=bool)


@pytest.fixture
def refine(world):
    """``refine(path, token)`` -> result of the backend's refiner on an empty map; "dock" stands 1 m along x of it."""
    navigation_map, transforms = world.map_of(nothing), TransformBuffer()
    transforms.set(Transform((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), "map", "dock", static=True))

    def make_context(base):
        return world.context(**vars(base), navigation_map=navigation_map, transforms=transforms)

    refiner_class = PluginRegistry(world.backend).load(PluginKind.REFINER, REFINERS[world.backend])
    with rig(refiner_class, make_context, None, Pose.planar(1.0, 1.0)) as made:
        yield lambda path, token=None: made.plugin.apply_refinement(path, token or CancelToken())


def in_frame(path, frame_id):
    return Path(path.positions, path.orientations, frame_id, path.stamp)


@pytest.mark.parametrize(
    ("path", "text"),
    [(CORNER[:1], "nothing to refine"), (OUT_AND_BACK, "the path drives backward somewhere and is left as it is")],
)
def test_a_path_that_is_not_refined_is_handed_back_with_the_reason(refine, path, text):
    result = refine(path)
    assert (result.outcome, result.message) == (RefinePathOutcome.SUCCESS, text)
    assert result.path is path


def test_a_path_in_an_unknown_frame_is_a_map_error(refine):
    result = refine(in_frame(CORNER, "moon"))
    assert result.outcome == RefinePathOutcome.MAP_ERROR
    assert result.message.startswith("the path cannot be transformed to the frame of the map: ")
    assert result.path.frame_id == "moon"


def test_a_canceled_refinement_has_the_reason_and_the_given_path(refine):
    result = refine(CORNER, canceled_token())
    assert (result.outcome, result.message) == (RefinePathOutcome.CANCELED, canceled_token().reason)
    assert result.path is CORNER


def test_a_path_in_another_frame_is_refined_there_and_comes_back_in_its_own(refine):
    here = refine(CORNER).path
    dock = refine(in_frame(CORNER, "dock")).path
    assert (here.frame_id, dock.frame_id) == ("map", "dock")
    assert here.length < CORNER.length
    np.testing.assert_allclose(dock.positions, here.positions, atol=1e-5)
