"""The questions to a map: points, poses, paths, the nearest valid pose; in free, blocked and unknown places."""

from __future__ import annotations

import math

from mbf_abstract.geometry import Path
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_abstract.testing.conformance.planning import FACE, NEAR, WALL
from mbf_abstract.testing.conformance.rig import Box, T_map_dock
from mbf_abstract.testing.conformance.site import Site, situation, somewhere

BESIDE = somewhere(3.65, 4.0)
"""A place from which it would not, but from ahead of it, below the robot."""
AWAY = somewhere(3.2, 4.0)
"""A place from which it would not."""
ABREAST = somewhere(2.0, 5.0)
"""A place one metre to the left of the robot."""


@situation()
def a_point_is_free_inscribed_lethal_or_outside(site: Site) -> None:
    """check_point returns FREE, INSCRIBED where a robot would touch something, LETHAL, and OUTSIDE or UNKNOWN."""
    site.place(WALL)
    site.expect_free(AWAY)
    site.expect_state(NEAR, CellState.INSCRIBED)
    site.expect_state(FACE, CellState.LETHAL)
    outside = site.server.queries.check_point(somewhere(40.0, 4.0)).state
    site.expect(outside in (CellState.OUTSIDE, CellState.UNKNOWN), f"off the ground check_point returns {outside.name}")


@situation()
def a_pose_is_lethal_where_the_robot_touches_something(site: Site) -> None:
    """check_pose returns LETHAL where the robot touches something, INSCRIBED where it covers inscribed places, or FREE.

    Without a pose it checks the robot's.
    """
    site.place(WALL)
    check = site.server.queries.check_pose
    for pose, state in (
        (None, CellState.FREE),
        (AWAY, CellState.FREE),
        (BESIDE, CellState.INSCRIBED),
        (NEAR, CellState.LETHAL),
        (FACE, CellState.LETHAL),
    ):
        found = check(pose).state
        site.expect(found is state, f"check_pose({pose}) returns {found.name}, expected {state.name}")
    grown = check(AWAY, PlaceQuery(safety_dist=0.7)).state
    site.expect(
        grown is CellState.LETHAL, f"with 0.7 m of safety check_pose returns {grown.name} 0.8 m before the wall"
    )


@situation()
def a_path_is_as_bad_as_its_worst_pose(site: Site) -> None:
    """check_path returns the worst state, stops where it is asked to, and checks no pose of an empty path."""
    site.place(WALL)
    queries, path = site.server.queries, site.path((2.0, 4.0), (4.2, 4.0))
    whole, early = queries.check_path(path), queries.check_path(path, return_on=CellState.LETHAL)
    site.expect(whole.state is CellState.LETHAL, f"the state of a path into the wall is {whole.state.name}")
    site.expect(whole.last_checked == len(path) - 1, f"it ended at pose {whole.last_checked} of {len(path)}")
    site.expect(early.state is CellState.LETHAL, f"with return_on the state is {early.state.name}")
    site.expect(5 < early.last_checked < 21, f"return_on ended it at pose {early.last_checked}")
    beside = queries.check_path(site.path((2.0, 4.0), (3.65, 4.0))).state
    site.expect(beside is CellState.INSCRIBED, f"the state of a path that ends beside the wall is {beside.name}")
    some = queries.check_path(path[:9], skip_poses=3)
    site.expect(some.state is CellState.FREE, f"the state of the free part is {some.state.name}")
    site.expect(some.last_checked == 8, f"with skip_poses 3 the last checked pose was {some.last_checked}, expected 8")
    none = queries.check_path(Path.from_poses([]))
    site.expect(none.last_checked == -1, f"of a path without poses it checked pose {none.last_checked}")
    site.expect_raises(ValueError, lambda: queries.check_path(path, skip_poses=-2), "skip_poses of -2")


@situation()
def a_valid_pose_is_the_nearest_one(site: Site) -> None:
    """find_valid_pose returns a free pose unchanged, else the nearest free one within the tolerance, else none."""
    site.place(WALL)
    find = site.server.queries.find_valid_pose
    free, beside, none = find(AWAY, 1.0, 0.0), find(NEAR, 1.0, 0.0), find(FACE, 0.1, 0.0)
    for name, answer, least, most in (("a free pose", free, 0.0, 0.15), ("a blocked one", beside, 0.0, 0.6)):
        asked = AWAY if answer is free else NEAR
        gap = math.inf if answer.pose is None else answer.pose.distance_to(asked)
        site.expect(least <= gap <= most, f"asked about {name} it returns one {gap:.2f} m away")
        site.expect(answer.state <= CellState.INSCRIBED, f"asked about {name} it returns {answer.state.name}")
    site.expect(none.pose is None, f"within 0.1 m of the wall it found {none.pose}")
    site.expect(none.state >= CellState.LETHAL, f"where nothing fits it returns {none.state.name}")
    outside = find(somewhere(40.0, 4.0), 1.0, 0.0)
    site.expect(outside.pose is None, f"metres off the ground it found {outside.pose}")
    site.expect(outside.state is CellState.OUTSIDE, f"metres off the ground it returns {outside.state.name}")
    site.expect_raises(ValueError, lambda: find(AWAY, -1.0, 0.0), "a negative tolerance")


@situation()
def poses_of_other_frames_are_transformed(site: Site) -> None:
    """Every question takes poses of known frames, and raises TransformError for those of unknown ones."""
    site.place(WALL)
    queries, dock = site.server.queries, T_map_dock.inverse()
    there = dock.apply_to_pose(FACE)
    path = dock.apply_to_path(site.path((2.0, 4.0), (4.0, 4.0)))
    site.expect_state(there, CellState.LETHAL)
    site.expect(queries.check_pose(there).state is CellState.LETHAL, "check_pose misses the wall in another frame")
    site.expect(queries.check_path(path).state is CellState.LETHAL, "check_path misses the wall in another frame")
    found = queries.find_valid_pose(there, 1.0, 0.0).pose
    site.expect(
        found is not None and found.frame_id == "map", f"find_valid_pose returns {found}, not in the map's frame"
    )
    lost = somewhere(1.0, 1.0, "nowhere")
    site.expect_raises(TransformError, lambda: queries.check_point(lost), "check_point in an unknown frame")
    site.expect_raises(TransformError, lambda: queries.check_pose(lost), "check_pose in an unknown frame")
    site.expect_raises(
        TransformError, lambda: queries.check_path(Path.from_poses([lost])), "check_path in an unknown frame"
    )
    site.expect_raises(
        TransformError, lambda: queries.find_valid_pose(lost, 1.0, 0.0), "find_valid_pose in an unknown frame"
    )


@situation()
def a_cleared_map_has_forgotten(site: Site) -> None:
    """clear_map removes what sensors have marked, update_map takes in what was seen since."""
    site.place(WALL)
    site.rig.sensing = False
    site.server.queries.clear_map()
    site.expect_free(FACE)
    site.sees(site.ray(2.0, 4.0, hit=True))
    site.expect_state(FACE, CellState.LETHAL)


@situation()
def a_cleared_area_has_forgotten(site: Site) -> None:
    """clear_area removes what sensors have marked in a square around the robot, or all outside it, and nothing else."""
    for inside in (True, False):
        site.rig.sensing = True
        site.place(WALL, Box(1.8, 5.0, 2.2, 5.2))
        site.expect_state(ABREAST, CellState.LETHAL)
        site.rig.sensing = False
        site.server.queries.clear_area(3.0, inside=inside)
        site.expect_free(ABREAST if inside else FACE)
        site.expect_state(FACE if inside else ABREAST, CellState.LETHAL)
    site.expect_raises(ValueError, lambda: site.server.queries.clear_area(0.0), "an area of 0 m")
