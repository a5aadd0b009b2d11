"""The kernels of the tracker against naive twins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.maps.tracking.kernels import filtering
from mbf_abstract.maps.tracking.kernels.clustering import BOX_COLUMNS, NEITHER, bounding_boxes, cluster

SENSOR = np.array([0.0, 0.0, 0.3])
coordinates = st.floats(-2.0, 2.0).map(lambda value: round(value, 2))
clouds = st.lists(st.tuples(coordinates, coordinates, st.sampled_from([0.0, 0.4])), max_size=40)


def naive_labels(points, distance):
    labels = [None] * len(points)
    for seed in range(len(points)):
        if labels[seed] is None:
            labels[seed], open_points = len({*labels} - {None}), [seed]
            while open_points:
                here = open_points.pop()
                for other in range(len(points)):
                    if labels[other] is None and math.dist(points[here], points[other]) <= distance:
                        labels[other] = labels[seed]
                        open_points.append(other)
    return labels


@given(clouds, st.sampled_from([0.15, 0.31, 0.77]))
@settings(max_examples=60, deadline=None)
def test_clusters_are_the_connected_components_of_near_points(cloud, distance):
    points = np.array(cloud, dtype=float).reshape(-1, 3)
    labels, count = cluster(points, np.argsort(points[:, 0], kind="stable"), distance)
    assert labels.tolist() == naive_labels(cloud, distance)
    assert count == len(set(labels.tolist()))


@given(clouds)
@settings(max_examples=30, deadline=None)
def test_boxes_hold_their_points(cloud):
    points = np.array(cloud, dtype=float).reshape(-1, 3)
    labels, count = cluster(points, np.argsort(points[:, 0], kind="stable"), 0.5)
    for number, box in enumerate(bounding_boxes(points, labels, count).tolist()):
        own = points[labels == number]
        sides = [own[:, 0].min(), own[:, 0].max(), own[:, 1].min(), own[:, 1].max()]
        assert box == pytest.approx([*sides, own[:, 2].mean(), len(own), NEITHER, NEITHER])


def naive_owners(middles, places, distance):
    pairs = sorted((math.dist(a, b), i, j) for i, a in enumerate(middles) for j, b in enumerate(places))
    owners, taken = [-1] * len(places), set()
    for gap, i, j in pairs:
        if gap <= distance and owners[j] == -1 and i not in taken:
            owners[j] = i
            taken.add(i)
    return owners


grid_places = st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), max_size=7)


@given(grid_places, grid_places)
@settings(max_examples=80, deadline=None)
def test_the_nearest_pairs_are_assigned_first_and_ties_to_the_lower_numbers(middles, places):
    states = np.zeros((len(middles), filtering.STATE_COLUMNS))
    states[:, [filtering.X, filtering.Y]] = np.array(middles, dtype=float).reshape(-1, 2)
    boxes = np.array([[x, x, y, y, 0.0, 5.0, NEITHER, NEITHER] for x, y in places], dtype=float)
    boxes = boxes.reshape(-1, BOX_COLUMNS)
    owners = filtering.assign(states, boxes, np.array([0.0, 0.0, 0.0]), 1.5, 3.0)
    assert owners.tolist() == naive_owners(middles, places, 3.0)


@given(
    st.lists(st.tuples(st.floats(0.02, 0.5), st.floats(-5.0, 5.0)), min_size=1, max_size=12),
    st.floats(0.01, 0.5),
    st.floats(0.1, 3.0),
    st.sampled_from([0.0, 0.5]),
)
@settings(max_examples=40, deadline=None)
def test_the_filter_is_that_of_the_textbook(steps, position_deviation, acceleration_deviation, turning_deviation):
    """Predict and correct against the matrix form of the Kalman filter, along x; points have no size.

    Where two innovations in a row have the same sign and are large, a step of the velocity at the last scan is added.
    """
    deviations = np.array([position_deviation, 0.6])
    states, stamp = np.zeros((1, filtering.STATE_COLUMNS)), 0.0
    first = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 5.0, NEITHER, NEITHER])
    filtering.born(first, SENSOR, stamp, states[0], deviations)
    mean, covariance, before = np.array([0.0, 0.0]), np.diag(deviations**2), 0.0
    weights = np.array([position_deviation, turning_deviation])
    for seconds, measured in steps:
        stamp += seconds
        filtering.predict(states, seconds, acceleration_deviation)
        box = np.array([[measured, measured, 1.0, 1.0, 0.0, 5.0, NEITHER, NEITHER]])
        filtering.correct(states, box, np.array([0]), SENSOR, stamp, seconds, weights, 0.0)
        model = np.array([[1.0, seconds], [0.0, 1.0]])
        push = np.array([0.5 * seconds**2, seconds]) * acceleration_deviation
        mean, covariance = model @ mean, model @ covariance @ model.T + np.outer(push, push)
        off = measured - mean[0]
        if off * before > filtering.TURNED**2 * (covariance[0, 0] + position_deviation**2):
            step = np.array([seconds, 1.0]) * turning_deviation
            covariance = covariance + np.outer(step, step)
        before = off
        gain = covariance[:, 0] / (covariance[0, 0] + position_deviation**2)
        mean = mean + gain * off
        covariance = covariance - np.outer(gain, covariance[0])
    state = states[0]
    assert state[[filtering.X, filtering.VX]] == pytest.approx(mean, rel=1e-6, abs=1e-9)
    found = state[[filtering.VAR_POSITION, filtering.COVARIANCE, filtering.VAR_VELOCITY]]
    assert found == pytest.approx(covariance[[0, 0, 1], [0, 1, 1]], rel=1e-6, abs=1e-9)
