"""Places on the lines of a path, and where a path leaves a map between its poses."""

import itertools

import numpy as np
import pytest

from mbf_abstract.geometry import Path
from mbf_abstract.geometry.polyline import places_between
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import RefineResult
from mbf_abstract.server.path_on_map import path_problem
from mbf_abstract.testing.scripted_session import ScriptedSession


def by_hand(points, spacing, longer_than):
    """The slow twin."""
    places, segments = [], []
    for index, (a, b) in enumerate(itertools.pairwise(points)):
        length = float(np.sqrt(((b - a) ** 2).sum()))
        count = int(np.ceil(length / spacing - 1e-9)) if length > longer_than else 1
        for number in range(1, count):
            places.append(a + number / count * (b - a))
            segments.append(index)
    return np.array(places).reshape(-1, points.shape[1]), segments


@pytest.mark.parametrize("count", [1, 2, 9])
@pytest.mark.parametrize("longer_than", [0.0, 1.0])
def test_places_between_points_are_no_farther_apart_than_the_spacing(count, longer_than):
    points = np.random.default_rng(count).uniform(0.0, 2.0, (count, 3))
    points = np.concatenate([points, points[-1:]])  # a segment without a length
    places, segments = places_between(points, 0.25, longer_than)
    expected, their_segments = by_hand(points, 0.25, longer_than)
    np.testing.assert_allclose(places, expected, atol=1e-12)
    assert segments.tolist() == their_segments


class MapWithGap:
    """Ground at x < 1 m and x > 2 m."""

    def first_outside(self, positions):
        outside = (positions[:, 0] >= 1.0) & (positions[:, 0] <= 2.0)
        return int(np.argmax(outside)) if outside.any() else -1

    def first_line_outside(self, positions):
        places, lines = places_between(positions, 0.1)
        index = self.first_outside(places)
        return int(lines[index]) if index >= 0 else -1


@pytest.mark.parametrize(
    ("xs", "problem"),
    [
        ((0.0, 0.5, 0.9), ""),
        ((0.0, 1.5, 3.0), "pose 1 of the path (1.50, 0.00, 0.00) is outside the map"),
        (
            (0.0, 0.5, 3.0),
            "the path leaves the map between its poses 1 (0.50, 0.00, 0.00) and 2 (3.00, 0.00, 0.00)",
        ),
    ],
)
def test_where_a_path_leaves_a_map_is_named(xs, problem):
    path = Path.from_points([(x, 0.0, 0.0) for x in xs])
    assert path_problem(MapWithGap(), path, path.positions) == problem


def test_a_given_path_off_the_map_is_no_fault_of_the_refiner(monkeypatch):
    with ScriptedSession() as session:
        path = session.path_to(3.0)
        monkeypatch.setattr(session.server, "path_problem", lambda path: "pose 1 of the path is outside the map")
        session.refiner.play(lambda path: RefineResult(0, "refined", path[:]))
        result = session.navigator.refine_path(path)
    assert (result.outcome, result.refined_path) == (RefinePathOutcome.MAP_ERROR, path)
    assert result.message == "before it was refined, pose 1 of the path is outside the map"


def test_a_path_that_the_refiner_leaves_as_it_is_is_not_judged(monkeypatch):
    with ScriptedSession() as session:
        monkeypatch.setattr(session.server, "path_problem", lambda path: "it is off the map")
        session.refiner.play(lambda path: RefineResult(0, "as it was", path))
        assert session.navigator.refine_path(session.path_to(3.0)).outcome == RefinePathOutcome.SUCCESS
