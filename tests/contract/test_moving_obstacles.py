"""A robot meets what moves, on both maps: it stops in time, goes on, and its map says what blocks its path."""

import math
import re
from functools import partial

import pytest

from mbf_abstract.compiling.kernel_cache import compile_lazily
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Twist
from mbf_abstract.maps.tracking import avoidance
from mbf_abstract.maps.tracking.kernels import meeting
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.outcomes import ExePathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.conformance.rig import ROBOT_RADIUS, Box
from mbf_abstract.testing.conformance.site import site
from mbf_abstract.time.clock import Priority

HALF, STEP = 0.25, 0.05  # m, s
PARAMETERS = {"controller_max_retries": -1, "controller_patience": 5.0}


@pytest.fixture(params=["costmap", "mesh"])
def make_map_server(request, backends):
    return backends[request.param]


class Walker:
    """A box that moves at constant velocity, and stops after some time; it does not stop for the robot.

    Where it is ``turns_at`` [m] before or behind the robot along x, it turns and walks to the robot's side. Nobody
    sees it at a y above ``hidden_above`` [m], as behind a corner.
    """

    def __init__(self, rig, x, y, vx, vy, until=math.inf, turns_at=None, hidden_above=math.inf):
        self.rig, self.x, self.y, self.vx, self.vy, self.until = rig, x, y, vx, vy, until
        self.hidden_above = hidden_above
        self.turns_at = turns_at
        self.touched_by = ""  # who moved when it first touched the robot: "robot", or "walker" alone
        self._place()
        rig.clock.spawn(self._walk, "walker", Priority.SIMULATOR)
        self.over = False
        rig.on_close(self.stop)

    def stop(self):
        self.over = True

    def _place(self):
        box = Box(self.x - HALF, self.y - HALF, self.x + HALF, self.y + HALF)
        self.rig.boxes = [] if self.y > self.hidden_above else [box]

    def _walk(self):
        clock, began, steps = self.rig.clock, self.rig.clock.now(), 0
        while not self.over:
            robot = self.rig.robot.pose
            if self.turns_at is not None and abs(self.x - robot.x) < self.turns_at:
                self.vx, self.vy = 0.0, math.copysign(self.vx, robot.y - self.y)
                self.turns_at = None
            if clock.now() - began < self.until:
                self.x, self.y = self.x + self.vx * STEP, self.y + self.vy * STEP
                self._place()
            pose = self.rig.robot.pose
            if not self.touched_by and any(box.gap(pose.x, pose.y) < ROBOT_RADIUS for box in self.rig.boxes):
                self.touched_by = "walker" if self.rig.robot.command.is_stopped() else "robot"
            steps += 1
            clock.sleep_until(began + steps * STEP)


def drive(made, walker_from, velocity, **changes):
    if changes:
        for name in made.server.served:
            made.server.set_layer_parameters(f"{name}.moving", **changes)
    walker = Walker(made.rig, *walker_from, *velocity)
    result = made.navigator.exe_path(made.path((2.0, 4.0), (8.0, 4.0)))
    return walker, result


SAMPLING = {
    ("costmap", "dwa"): ((4.4, 7.0), (0.0, -0.6)),
    ("costmap", "mppi"): ((4.4, 7.0), (0.0, -0.6)),
    ("mesh", "mppi"): ((4.0, 7.0), (0.0, -1.2)),
}
CROSSINGS = {"costmap": ((4.4, 7.3), (0.0, -0.6)), "mesh": ((4.0, 7.5), (0.0, -1.2))}


def test_the_robot_touches_nobody_who_crosses_its_path(make_map_server):
    with site(make_map_server, **PARAMETERS) as made:
        walker, result = drive(made, *CROSSINGS[made.server.backend])
        assert result.success, result.message
        assert walker.touched_by == ""


@pytest.mark.parametrize(("backend", "controller"), SAMPLING)
def test_a_sampling_controller_lets_those_who_cross_go_by(backends, backend, controller):
    with site(partial(backends[backend], controller=controller), **PARAMETERS) as made:
        walker, result = drive(made, *SAMPLING[backend, controller])
        assert result.success, result.message
        assert walker.touched_by != "robot"


@pytest.mark.parametrize(("backend", "controller"), SAMPLING)
def test_a_sampling_controller_avoids_them_without_the_guard_too(backends, backend, controller):
    """Without looking at where people will be, all three drive into this one, as the guard is off."""
    with site(partial(backends[backend], controller=controller), **PARAMETERS) as made:
        walker, result = drive(made, *SAMPLING[backend, controller], stop_before_contact=False)
        assert result.success, result.message
        assert walker.touched_by == ""


@pytest.mark.parametrize(("backend", "controller"), SAMPLING)
def test_what_looks_ahead_is_compiled_before_the_robot_drives(backends, monkeypatch, backend, controller):
    """A robot whose controller compiles while somebody comes drives on unguarded."""
    fresh = compile_lazily(meeting.write_encounters.py_func, error_model="numpy")
    monkeypatch.setattr(meeting, "write_encounters", fresh)
    avoidance._nobody.cache_clear()
    with site(partial(backends[backend], controller=controller), **PARAMETERS) as made:
        path = made.path((2.0, 4.0), (8.0, 4.0))
        made.server.warm_up(path[0], path[-1])
        compiled = list(fresh.signatures)
        assert compiled
        drive(made, *SAMPLING[backend, controller])
        assert fresh.signatures == compiled


@pytest.mark.parametrize(("backend", "controller"), SAMPLING)
def test_a_controller_that_lets_somebody_by_waits_no_longer_than_it_may(backends, backend, controller):
    """With the guard off only the controller waits."""
    with site(partial(backends[backend], controller=controller), **PARAMETERS) as made:
        made.server.set_parameters(controller_max_retries=0)
        walker, result = drive(made, *SAMPLING[backend, controller], stop_before_contact=False, max_wait=0.1)
        assert result.outcome == ExePathOutcome.BLOCKED_PATH
        assert re.fullmatch(r"object \d+ moves in the way, at .*; waited 0.\d s for it", result.message)
        assert walker.touched_by == ""


def test_without_the_guard_it_drives_into_them(make_map_server):
    with site(make_map_server, **PARAMETERS) as made:
        walker, _ = drive(made, *CROSSINGS[made.server.backend], stop_before_contact=False)
        assert walker.touched_by == "robot"


@pytest.mark.parametrize(("turning_time", "moved"), [(0.5, "walker"), (0.0, "robot")])
def test_the_robot_stands_when_somebody_beside_it_turns_and_runs_into_it(make_map_server, turning_time, moved):
    """A turn is noticed late, so a robot that does not reckon with it is touched before it can stand."""
    with site(make_map_server, **PARAMETERS) as made:
        for name in made.server.served:
            made.server.set_layer_parameters(f"{name}.moving", turning_time=turning_time)
        walker = Walker(made.rig, 8.5, 4.9, -1.5, 0.0, turns_at=0.2)
        made.navigator.exe_path(made.path((2.0, 4.0), (8.0, 4.0)))
        assert walker.touched_by == moved


def test_the_robot_stands_when_somebody_runs_into_it(make_map_server):
    """Whoever comes along its path and does not stop touches a robot that stands."""
    with site(make_map_server, **PARAMETERS) as made:
        walker, _ = drive(made, (7.5, 4.0), (-0.7, 0.0))
        assert walker.touched_by == "walker"


COMES_OUT = {"costmap": (4.6, 7.3, 0.0, -0.6), "mesh": (4.4, 6.2, 0.0, -0.6)}


def test_the_robot_stands_before_who_comes_out_from_behind_a_corner(make_map_server):
    """Somebody seen for the first time has not moved yet; waiting until they have come 0.25 m far is too late."""
    with site(make_map_server, **PARAMETERS) as made:
        walker = Walker(made.rig, *COMES_OUT[made.server.backend], hidden_above=4.9)
        result = made.navigator.exe_path(made.path((2.0, 4.0), (8.0, 4.0)))
        assert result.success, result.message
        assert walker.touched_by == "walker"  # who looks at nothing, and runs into it


def test_a_robot_whose_turns_cancel_out_does_not_drive_straight_into_somebody(make_map_server):
    """Each command alone leads aside on a tiny circle; the robot is too heavy to turn so fast and goes straight on."""
    with site(make_map_server, **PARAMETERS) as made:
        walker, robot = Walker(made.rig, 7.0, 4.0, -0.3, 0.0), made.rig.robot
        velocity, turn, shares = Twist(), 4.0, []
        while not walker.touched_by and made.rig.clock.now() < 15.0:
            turn = -turn
            wanted = ControlResult(ExePathOutcome.SUCCESS, "", Twist.planar(0.9, 0.0, turn))
            command = made.server.avoid_contact(robot.pose, velocity, wanted).command or Twist()
            shares.append(command.vx / 0.9)
            velocity = Twist.planar(
                velocity.vx + max(-0.5 * STEP, min(0.5 * STEP, command.vx - velocity.vx)),
                0.0,
                velocity.wz + max(-1.0 * STEP, min(1.0 * STEP, command.wz - velocity.wz)),
            )
            robot.send_command(velocity)
            made.rig.clock.sleep(STEP)
        assert shares[0] == 1.0 and walker.touched_by == "walker"


def test_a_recovery_touches_nobody_either(make_map_server):
    """It waits until they have walked on, who look at nothing; on the mesh what is marked now ends it before that."""
    with site(make_map_server, **PARAMETERS) as made:
        walker = Walker(made.rig, 0.4, 4.0, 0.3, 0.0)
        made.rig.clock.sleep(1.5)
        result = made.navigator.recover("back_up")
        if made.server.backend == "costmap":
            assert result.success and walker.touched_by == "walker", result.message
        else:
            assert result.outcome == RecoveryOutcome.IMPASSABLE and "in the way" in result.message
            assert walker.touched_by != "robot"


def test_a_guard_that_raises_holds_the_robot(make_map_server):
    with site(make_map_server, controller_max_retries=0) as made:

        def raising(pose, velocity, answer):
            raise RuntimeError("no objects today")

        made.server.avoid_contact = raising
        result = made.navigator.exe_path(made.path((2.0, 4.0), (4.0, 4.0)))
        assert result.outcome == ExePathOutcome.MAP_ERROR
        assert "avoid_contact raised RuntimeError: no objects today" in result.message
        assert not made.rig.robot.moved_after(0.0)


def test_a_map_knows_who_moves_on_it_and_what_blocks_a_path(make_map_server):
    with site(make_map_server, **PARAMETERS) as made:
        queries, path = made.server.queries, made.path((2.0, 4.0), (8.0, 4.0))
        assert queries.tracked_objects() == () == queries.what_blocks(path)
        Walker(made.rig, 4.0, 6.5, 0.0, -0.5, until=5.0)
        made.rig.clock.sleep(2.5)
        (seen,) = queries.tracked_objects()
        assert seen.motion is Motion.MOVING and seen.frame_id == "map"
        assert (seen.vx, seen.vy) == pytest.approx((0.0, -0.5), abs=0.15)
        (blockage,) = queries.what_blocks(path, within_time=3.0)
        assert blockage.by.number == seen.number and 1.0 < blockage.distance < 2.0
        made.rig.clock.sleep(5.0)
        (blockage,) = queries.what_blocks(path)
        assert blockage.by.motion is Motion.WAITING and blockage.by.speed == 0.0
        motions = [event.data["motion"] for event in made.rig.memory.of_kind(EventKind.OBJECT)]
        assert motions[0] == "moving" and motions[-1] == "waiting"
        with pytest.raises(ValueError, match="within_time must be 0 s or more and finite, got nan"):
            queries.what_blocks(path, within_time=math.nan)


@pytest.mark.parametrize("name", ["elevation_grid"])
def test_a_map_without_such_a_layer_knows_nobody(backends, name):
    with site(backends[name], **PARAMETERS) as made:
        path = made.path((2.0, 4.0), (8.0, 4.0))
        assert made.server.queries.tracked_objects() == () == made.server.queries.what_blocks(path)
