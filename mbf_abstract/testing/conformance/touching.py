"""What every backend does where the robot touches an obstacle from the start: it gets away, and goes no deeper."""

from __future__ import annotations

from mbf_abstract.maps.queries import PADDED, CellState
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.conformance.rig import START, Box
from mbf_abstract.testing.conformance.site import Site, situation

GAP = 0.22
"""Distance [m] of the robot's centre, whose radius is 0.3 m, from what it touches."""
BEHIND, AHEAD = Box(1.4, 3.0, 2.0 - GAP, 5.0), Box(2.0 + GAP, 3.0, 2.6, 5.0)


@situation(controller_max_retries=0)
def a_robot_that_touches_something_drives_away_from_it(site: Site) -> None:
    """A robot that touches an obstacle behind it drives along a path that leads away."""
    site.place(BEHIND)
    result = site.navigator.exe_path(site.path((2.0, 4.0), (5.0, 4.0)))
    site.expect_outcome(result, ExePathOutcome.SUCCESS)
    site.expect_near(5.0, 4.0, 0.25, "arrived")
    site.expect_no_contact()


@situation(controller_max_retries=0)
def a_robot_that_touches_something_goes_no_deeper(site: Site) -> None:
    """A robot that touches an obstacle stands and ends its path with COLLISION where that leads farther into it.

    On a map that frees what lies below the robot it touches nothing that the map knows.
    """
    site.place(AHEAD)
    touches = site.server.queries.check_pose(START, PADDED).state is CellState.LETHAL
    result = site.navigator.exe_path(site.path((2.0, 4.0), (5.0, 4.0)))
    if touches:
        site.expect_outcome(result, ExePathOutcome.COLLISION, "the robot touches an obstacle", "leads farther into it")
    else:
        site.expect_outcome(result, ExePathOutcome.BLOCKED_PATH, "an obstacle is in the way")
    site.expect_near(2.0, 4.0, 0.02, "the path leads into the obstacle")
    site.expect_no_contact()
