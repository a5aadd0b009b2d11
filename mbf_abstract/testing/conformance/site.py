"""One situation of the conformance suite: a backend's server on a rig, and what is expected of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.result_types import ActionResult
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import is_success, outcome_name
from mbf_abstract.plugins import PluginKind
from mbf_abstract.testing.conformance.rig import SENSOR, BackendRig, Box, MakeServer
from mbf_abstract.testing.contract.report import Report

PARAMETERS: dict[str, Any] = {
    "planner_max_retries": 0,
    "planner_patience": 5.0,
    "controller_patience": 3.0,
    "recovery_patience": 20.0,
    "dist_tolerance": 0.2,
    "angle_tolerance": 3.14,
    "tf_timeout": 1.0,
}
"""Parameters of every situation without others; the robot need not turn at its goals."""
SPACING = 0.1  # m between the poses of a path


class Site:
    """A server with its world, and the expectations of one situation.

    Attributes
    ----------
    navigator : Navigator
    """

    def __init__(self, rig: BackendRig, server: Any, report: Report) -> None:
        self.rig, self.server, self.navigator = rig, server, Navigator(server)
        self._report = report

    @property
    def map(self) -> NavigationMap:
        """The map that the robot is held by."""
        found: NavigationMap = self.server.plugins.find(PluginKind.RECOVERY, "rotate").instance.navigation_map
        return found

    # ------------------------------------------------------------------------------------------ expectations
    def expect(self, condition: bool, text: str) -> None:
        """Record what is wrong unless the condition holds."""
        self._report.expect(condition, text)

    def expect_outcome(self, result: ActionResult, outcome: int, *texts: str) -> None:
        """Expect an outcome, and that the message contains each of ``texts``."""
        wanted = "success" if is_success(outcome) else outcome_name(outcome)
        got = f"{result.outcome_name}: {result.message}"
        self.expect(
            result.outcome == outcome or (result.success and is_success(outcome)), f"expected {wanted}, got {got}"
        )
        for text in texts:
            self.expect(text in result.message, f"expected a message that contains {text!r}, got {got}")

    def expect_raises(self, errors: type[Exception], call: Callable[[], object], what: str, *texts: str) -> None:
        """Expect an exception whose text is one line and contains each of ``texts``."""
        try:
            answer = call()
        except errors as error:
            self.expect(bool(str(error)), f"{what}: {type(error).__name__} without a text")
            self.expect("\n" not in str(error), f"{what}: expected a text of one line, got {str(error)!r}")
            for text in texts:
                self.expect(text in str(error), f"{what}: expected a text that contains {text!r}, got {str(error)!r}")
        except Exception as error:
            self.expect(False, f"{what}: expected {errors.__name__}, got {type(error).__name__}: {error}")
        else:
            self.expect(False, f"{what}: expected {errors.__name__}, got {answer}")

    def expect_near(self, x: float, y: float, distance: float, what: str) -> None:
        """Expect the robot within ``distance`` [m] of a place."""
        pose = self.rig.robot.pose
        gap = math.hypot(pose.x - x, pose.y - y)
        self.expect(
            gap <= distance, f"{what}: the robot is {gap:.2f} m from ({x:g}, {y:g}), allowed are {distance:g} m"
        )

    def expect_stands(self, seconds: float, why: str) -> None:
        """Expect that the robot does not move for some time [s]."""
        before = self.rig.robot.pose
        self.rig.clock.sleep(seconds)
        moved, turned = before.distance_to(self.rig.robot.pose), before.angle_to(self.rig.robot.pose)
        self.expect(
            moved < 0.01 and turned < 0.01, f"{why}: it moved {moved:.2f} m and {turned:.2f} rad in {seconds:g} s"
        )

    def expect_moves(self, seconds: float, why: str) -> None:
        """Expect that the robot moves within some time [s]."""
        before = self.rig.robot.pose
        self.rig.clock.sleep(seconds)
        pose = self.rig.robot.pose
        moved = before.distance_to(pose) > 0.05 or before.angle_to(pose) > 0.05
        self.expect(
            moved, f"{why}: it did not move in {seconds:g} s ({self.server.map_problem() or 'the map is current'})"
        )

    def expect_no_contact(self) -> None:
        """Expect that the robot's centre was never nearer to a box than 0.2 m: its radius less the rounding of maps."""
        gap = self.rig.least_gap()
        self.expect(gap > 0.2, f"the robot's centre came to {gap:.2f} m from an obstacle")

    def expect_visits(self, places: Sequence[tuple[float, float]], distance: float = 0.4) -> None:
        """Expect that the robot came to all places [m], in their order."""
        waiting = list(places)
        for _, x, y in self.rig.track:
            if waiting and math.hypot(x - waiting[0][0], y - waiting[0][1]) <= distance:
                waiting.pop(0)
        missed = f"({waiting[0][0]:g}, {waiting[0][1]:g})" if waiting else ""
        self.expect(
            not waiting, f"the robot never came to {missed}, {len(waiting)} of {len(places)} places were left out"
        )

    def expect_state(self, place: Pose, state: CellState) -> None:
        """Expect the state that ``check_point`` returns for a place."""
        found = self.server.queries.check_point(place).state
        self.expect(
            found is state, f"check_point returns {found.name} at ({place.x:g}, {place.y:g}), expected {state.name}"
        )

    def expect_free(self, place: Pose) -> None:
        """Expect that nothing is known to be at a place; UNKNOWN is as good as FREE."""
        found = self.server.queries.check_point(place).state
        free = found in (CellState.FREE, CellState.UNKNOWN)
        self.expect(free, f"check_point returns {found.name} at ({place.x:g}, {place.y:g}), expected FREE")

    # ------------------------------------------------------------------------------------------ steps
    def place(self, *boxes: Box) -> None:
        """Replace the obstacles, and let the sensor see them."""
        self.rig.boxes = list(boxes)
        self.rig.clock.sleep(0.6)
        self.server.queries.update_map()

    def sees(self, scan: RangeScan) -> None:
        """Hand over one scan several times, for maps that need several hits, and update the map."""
        for _ in range(4):
            self.server.take_scan(scan)
        self.server.queries.update_map()

    def path(self, *corners: tuple[float, float]) -> Path:
        """Path along straight lines between corners [m], with a pose every 0.1 m."""
        points = [(*corners[0], 0.0)]
        for (x0, y0), (x1, y1) in pairwise(corners):
            count = max(1, round(math.hypot(x1 - x0, y1 - y0) / SPACING))
            points += [(x0 + (x1 - x0) * k / count, y0 + (y1 - y0) * k / count, 0.0) for k in range(1, count + 1)]
        return Path.from_points(points)

    def ray(self, x0: float, x1: float, hit: bool, source: str = SENSOR, stamp: float | None = None) -> RangeScan:
        """Scan of a single ray, in the frame of the map, along y = 4 m from one x [m] to another."""
        stamp = self.rig.clock.now() if stamp is None else stamp
        ends = np.array([[x1, 4.0, 0.4]])
        return RangeScan(source, "map", np.array([x0, 4.0, 0.4]), ends, np.array([hit]), stamp)


@dataclass(frozen=True)
class Situation:
    """One situation in which every backend has to do the same.

    Attributes
    ----------
    name : str
        Identifier of the situation.
    sentence : str
        The rule that it checks.
    check : callable
        Checks the rule.
    parameters : mapping
        Parameters of the server that differ from those of all situations.
    """

    name: str
    sentence: str
    check: Callable[[Site], None]
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def run(self, make_server: MakeServer) -> None:
        """Make a server and check it; raises ContractBroken with everything that is wrong."""
        report = Report(self.name, contract=f"contract of map backends, by which {self.sentence}")
        with report.no_exception("the situation"), site(make_server, report, **self.parameters) as made:
            self.check(made)
            errors = made.rig.sensor_errors
            made.expect(not errors, f"take_scan raised {len(errors)} times, first {errors[:1]}")
        report.finish()


def situation(**parameters: Any) -> Callable[[Callable[[Site], None]], Situation]:
    """Make a situation of a check; the first line of its docstring is the sentence."""

    def decorate(check: Callable[[Site], None]) -> Situation:
        sentence = (check.__doc__ or "").strip().split("\n")[0].rstrip(".")
        return Situation(check.__name__, sentence[:1].lower() + sentence[1:], check, parameters)

    return decorate


@contextmanager
def site(make_server: MakeServer, report: Report | None = None, **parameters: Any) -> Iterator[Site]:
    """Make a server in a world of its own, wait until its map is current, and close both afterwards."""
    with TemporaryDirectory() as folder, BackendRig(FilePath(folder)) as rig:
        server = make_server(rig, **{**PARAMETERS, **parameters})
        rig.on_close(server.close)  # also where make_server has not asked the rig for it
        rig.start_sensor(server)
        rig.clock.sleep(0.55)
        yield Site(rig, server, report or Report("site"))


def somewhere(x: float, y: float, frame_id: str = "map") -> Pose:
    """Pose at a place [m]."""
    return Pose.planar(x, y, 0.0, frame_id=frame_id)
