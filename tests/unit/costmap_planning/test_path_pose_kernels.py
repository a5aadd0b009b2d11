"""Poses along a path from the kernels are, bit for bit, those of the numpy formulas."""

import numpy as np
import pytest

from mbf_abstract.geometry import Path, quaternion_from_yaw
from mbf_abstract.geometry.arithmetic import arctan2, plane_rotation, rotated
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.kernels.map.path_poses import (
    course_along,
    first_off_grid,
    headed_poses,
    level_path,
    yaw_quaternions,
)
from mbf_costmap_nav.planning.manoeuvres import Manoeuvres
from mbf_costmap_nav.planning.outline_course import Course


def paths():
    """Random paths (k, 2) [m]: along cells, from place to place, with repeated points, of one point."""
    rng = np.random.default_rng(6)
    for count in (1, 2, 3, 7, 60, 700):
        for _ in range(12):
            yield rng.uniform(-20.0, 20.0, (count, 2))
            cells = np.cumsum(rng.integers(-1, 2, (count, 2)), axis=0)  # stays where it is, now and then
            yield 0.05 * (cells + 0.5) - 3.0
            yield np.repeat(rng.uniform(-1.0, 1.0, (count, 2)), 2, axis=0)
    yield np.zeros((4, 2))


def course_by_numpy(points, spacing, arm):
    given = polyline_lengths(points)
    steps = np.diff(given)
    counts = np.maximum(1, np.ceil(steps / spacing - 1e-9)).astype(np.int64)
    inner = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    filled = np.repeat(given[:-1], counts) + np.repeat(steps / counts, counts) * inner
    lengths = np.append(filled, given[-1])
    before, places, behind = (
        np.column_stack([np.interp(lengths + side, given, axis) for axis in points.T]) for side in (-arm, 0.0, arm)
    )
    toward = behind - before
    return np.column_stack([places, arctan2(toward[:, 1], toward[:, 0])]), lengths


def same_bytes(ours, expected):
    assert ours.shape == expected.shape and ours.dtype == expected.dtype
    assert ours.tobytes() == np.ascontiguousarray(expected).tobytes()


@pytest.mark.parametrize("spacing", [0.05, 0.3])
def test_the_course_along_a_path_has_the_bytes_of_numpy(spacing):
    for points in paths():
        for ours, expected in zip(
            course_along(points, spacing, 0.2), course_by_numpy(points, spacing, 0.2), strict=True
        ):
            same_bytes(ours, expected)


def test_poses_that_look_to_the_next_point_have_the_bytes_of_numpy():
    for points in paths():
        steps = np.diff(points, axis=0, append=points[-1:])
        same_bytes(headed_poses(points), np.column_stack([points, arctan2(steps[:, 1], steps[:, 0])]))


@pytest.mark.parametrize("heights", [(0.0, 0.0), (1.0, -0.5), (-0.0, 0.0), (-2.0, -2.0)])
def test_a_level_path_has_the_bytes_of_numpy(heights):
    for points in paths():
        along = polyline_lengths(points)
        share = along / along[-1] if along[-1] > 0.0 else along
        z = heights[0] + share * (heights[1] - heights[0])
        expected = Path.from_points(np.column_stack([points, z]))
        positions, orientations, length = level_path(points, *heights)
        same_bytes(positions, expected.positions)
        same_bytes(orientations, expected.orientations)
        assert length == pytest.approx(expected.length, rel=1e-12)


def test_a_level_path_of_finite_length_has_finite_numbers_only():
    points, highest = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]), np.finfo(np.float64).max
    for heights in ((highest, -highest), (0.0, highest), (-1e200, 1e200), (1e100, 1e100), (0.0, 1e150)):
        positions, orientations, length = level_path(points, *heights)
        finite = bool(np.isfinite(positions).all() and np.isfinite(orientations).all())
        assert finite or not np.isfinite(length)


def test_quaternions_of_yaws_have_the_bytes_of_the_geometry():
    yaws = np.concatenate([np.random.default_rng(2).uniform(-20.0, 20.0, 2000), [0.0, -0.0, np.pi, 1e-300]])
    same_bytes(yaw_quaternions(yaws), np.array([quaternion_from_yaw(yaw) for yaw in yaws.tolist()]))


def test_the_first_lethal_cell_under_a_footprint_is_that_of_numpy():
    rng = np.random.default_rng(8)
    check = FootprintCheck(Footprint([[-0.5, -0.25], [0.5, -0.25], [0.6, 0.25]]), 0.05)
    found = 0
    for _ in range(400):
        costmap = Costmap(np.where(rng.random((40, 50)) < 0.02, 254, 0).astype(np.uint8), 0.05, -1.0, 0.3)
        x, y, yaw = rng.uniform((-1.5, 0.0, -4.0), (2.0, 2.5, 4.0)).tolist()
        points = rotated(plane_rotation(yaw), check.samples) + np.array([x, y])
        cells, inside = costmap.world_to_cells(points)
        cells = cells[inside]
        lethal = cells[costmap.cells[cells[:, 1], cells[:, 0]] == 254]
        expected = costmap.cell_to_world(*lethal[0].tolist()) if len(lethal) else None
        assert check.touched(costmap, x, y, yaw) == expected
        found += expected is not None
    assert 100 < found < 390


def test_an_outline_fits_along_where_course_turns_and_headings_say_so():
    rng, answers = np.random.default_rng(9), []
    outline = Footprint([[-0.3, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.3, 0.2]])
    check = FootprintCheck(outline, 0.05)
    for _ in range(600):
        costmap = Costmap(np.where(rng.random((120, 120)) < 1.5e-3, 254, 0).astype(np.uint8), 0.05)
        points = 0.05 * (np.cumsum(rng.integers(-1, 2, (int(rng.integers(1, 60)), 2)), axis=0) + 60.5)
        start, end = (float(yaw) if rng.random() < 0.7 else None for yaw in rng.uniform(-4.0, 4.0, 2))
        course = Course.along(points, costmap.resolution, start, end)
        headed = check.collisions(costmap, headed_poses(points))[1:-1]
        expected = not (course.misfits(check, costmap).any() or headed.any() or course.lengths[-1] == 0.0)
        manoeuvres = Manoeuvres(costmap, outline, 0.0, 3.0, True, 100, CancelToken())
        assert manoeuvres._fits(points, start, end) == expected
        answers.append(expected)
    assert 0.2 < np.mean(answers) < 0.8


def test_the_first_collision_is_that_of_looking_at_every_sample_of_every_pose():
    rng, answers = np.random.default_rng(10), []
    outlines = [[-0.3, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.3, 0.2]], [[0.1, 0.0], [0.3, 0.1], [0.2, 0.2]], []
    for number in range(900):
        check = FootprintCheck(Footprint(outlines[number % 3]), 0.05)
        share = (3e-4, 3e-3, 3e-2)[number // 3 % 3]
        costmap = Costmap(np.where(rng.random((90, 70)) < share, 254, 255).astype(np.uint8), 0.05, -1.0, 0.4)
        steps = rng.uniform(-1.0, 1.0, (60, 3)) * (0.05, 0.05, 0.2) * rng.choice([0.2, 1.0, 8.0])
        poses = rng.uniform((-1.5, 0.0, -4.0), (3.0, 5.5, 4.0)) + np.cumsum(steps, axis=0)  # some lead off the map
        hits = check.collisions(costmap, poses)
        expected = int(np.argmax(hits)) if hits.any() else -1
        assert check.first_collision(costmap, poses) == expected
        answers.append(expected)
    assert 0.2 < np.mean(np.array(answers) >= 0) < 0.8


def test_a_cell_whose_corner_a_sample_just_reaches_counts():
    cells = np.zeros((40, 40), dtype=np.uint8)
    cells[20, 30] = 254
    costmap = Costmap(cells, 0.05)
    poses = np.array([[1.0, 1.025, 0.0], [1.1, 1.025, 0.0], [1.2, 1.025, 0.0], [1.2 + 1e-9, 1.025, 0.0]])
    check = FootprintCheck(Footprint([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]]), 0.05)
    hits = check.collisions(costmap, poses)
    assert hits[-1] and not hits[0]
    assert check.first_collision(costmap, poses) == int(np.argmax(hits))


def test_the_first_point_off_a_grid_is_that_of_looking_up_every_cell():
    rng, answers = np.random.default_rng(11), []
    costmap = Costmap(np.zeros((60, 80), dtype=np.uint8), 0.05, -2.0, 0.5)
    corners = [[-2.0, 0.5, 0.0], [2.0, 0.5, 0.0], [-2.0, 3.5, 0.0], [1.999, 3.499, 0.0], [-2.0 - 1e-9, 1.0, 0.0]]
    for points in [np.array([corner]) for corner in corners] + [np.zeros((0, 3))]:
        outside = ~costmap.world_to_cells(points)[1]
        assert first_off(costmap, points) == (int(np.argmax(outside)) if outside.any() else -1)
    for _ in range(300):
        points = rng.uniform((-2.02, 0.48, -9.0), (2.02, 3.52, 9.0), (int(rng.integers(1, 60)), 3))
        outside = ~costmap.world_to_cells(points)[1]
        answers.append(int(np.argmax(outside)) if outside.any() else -1)
        assert first_off(costmap, points) == answers[-1]
    assert 0.1 < np.mean(np.array(answers) >= 0) < 0.9


def first_off(costmap, points):
    size = costmap.width, costmap.height, costmap.resolution, costmap.origin_x, costmap.origin_y
    return first_off_grid(points, *size)
