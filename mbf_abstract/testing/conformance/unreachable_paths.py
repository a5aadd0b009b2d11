"""Paths that no robot drives: in a frame nobody knows, far away, or on another storey."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mbf_abstract.outcomes import ExePathOutcome, MoveBaseOutcome
from mbf_abstract.testing.conformance.rig import START
from mbf_abstract.testing.conformance.site import Site, situation, somewhere


@situation()
def a_path_in_an_unknown_frame_is_a_tf_error(site: Site) -> None:
    """A path in an unknown frame, or a pose to go to, ends with TF_ERROR and the name of the frame."""
    path = replace(site.path((2.0, 4.0), (5.0, 4.0)), frame_id="nowhere")
    site.expect_outcome(site.navigator.exe_path(path), ExePathOutcome.TF_ERROR, "nowhere")
    site.expect_outcome(site.navigator.go_to(somewhere(5.0, 4.0, "nowhere")), MoveBaseOutcome.TF_ERROR, "nowhere")


@situation(controller_max_retries=0)
def a_path_far_from_the_robot_is_missed(site: Site) -> None:
    """A path that begins metres away from the robot ends with MISSED_PATH, and the robot does not move."""
    result = site.navigator.exe_path(site.path((8.0, 6.0), (10.0, 6.0)))
    site.expect_outcome(result, ExePathOutcome.MISSED_PATH, "the robot is 6.32 m from the path, allowed")
    site.expect_near(START.x, START.y, 0.05, "the path is elsewhere")


@situation(controller_max_retries=0)
def a_path_on_another_storey_is_missed(site: Site) -> None:
    """A path metres above the robot ends with MISSED_PATH on a map with heights; a flat map has no storeys."""
    flat, path = site.map.same_storey == math.inf, site.path((2.0, 4.0), (5.0, 4.0))
    result = site.navigator.exe_path(replace(path, positions=path.positions + np.array([0.0, 0.0, 4.0])))
    if flat:
        site.expect_outcome(result, ExePathOutcome.SUCCESS)
    else:
        site.expect_outcome(result, ExePathOutcome.MISSED_PATH, "the robot is 4.00 m from the path, allowed")
        site.expect_near(START.x, START.y, 0.05, "the path is on another storey")
