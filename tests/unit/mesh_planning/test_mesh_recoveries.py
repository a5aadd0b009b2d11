"""Recoveries on meshes: what they do on free and on forbidden ground, and that every way out ends with zero."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.maps.recoveries.back_up import BackUpRecovery
from mbf_abstract.maps.recoveries.clear import ClearRecovery
from mbf_abstract.maps.recoveries.relax import RelaxRecovery
from mbf_abstract.maps.recoveries.rotate import RotateRecovery
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import RecoveryRequest
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.layers.inflation import InflationLayer
from mbf_mesh_nav.map.layer import NOTHING_CHANGED, LayerContext
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.recoveries.escape import EscapeRecovery


class SimulatedMotion:
    """A unicycle on the surface; sleeping advances the recovery's clock. ``stop_after``: sleeps until a cancel."""

    def __init__(self, mesh_map, pose_on, clock, position, heading, stop_after=10**9, gate_open=True):
        self.mesh_map, self.pose_on, self.clock = mesh_map, pose_on, clock
        self.current = pose_on(mesh_map, position, heading)
        self.commands, self.stop_after, self.gate_open = [], stop_after, gate_open

    def pose(self):
        return self.current

    def velocity(self):
        return self.commands[-1] if self.commands else Twist()

    def send(self, command):
        self.commands.append(command)
        return self.gate_open

    def sleep(self, seconds):
        command, (x, y, _) = self.commands[-1], self.current.rotation.T
        turned = math.cos(command.wz * seconds) * x + math.sin(command.wz * seconds) * y
        ahead = np.asarray(self.current.position) + command.vx * seconds * turned
        self.current = self.pose_on(self.mesh_map, ahead, turned)
        self.clock.time += seconds
        self.stop_after -= 1
        return self.stop_after > 0


class CarEscape(EscapeRecovery):
    """Of a robot that cannot turn on the spot."""

    def __init__(self, context):
        super().__init__(context)
        self.min_turning_radius = 0.6


ESCAPES = pytest.mark.parametrize("escape", [EscapeRecovery, CarEscape])


class TrackedRobot:
    """A robot that knows how it came here."""

    def __init__(self, track=()):
        self.track = np.reshape(track, (-1, 3))

    def recent_track(self):
        return self.track


@pytest.fixture
def run(make_plugin, pose_on):
    """Factory: run a recovery on a map from a pose; returns the result and the simulated motion."""

    def run_it(
        recovery_class,
        mesh_map,
        position=(3.0, 3.0, 0.0),
        heading=(1, 0, 0),
        motion=None,
        token=None,
        track=(),
        motion_class=SimulatedMotion,
        **params,
    ):
        recovery = make_plugin(recovery_class, mesh_map, robot=TrackedRobot(track), **params)
        simulated = motion_class(mesh_map, pose_on, recovery.clock, position, heading, **(motion or {}))
        result = recovery.run_behavior(RecoveryRequest(simulated, token or CancelToken()))
        assert not simulated.commands or simulated.commands[-1] == Twist()
        return result, simulated

    return run_it


def test_backing_up_drives_the_distance_straight_back(run, plain):
    result, motion = run(BackUpRecovery, plain(), distance=0.6)
    assert result.success, result.message
    assert motion.current.x == pytest.approx(2.4, abs=0.05) and motion.current.y == pytest.approx(3.0, abs=1e-6)


def test_backing_up_follows_the_driven_curve(run, plain):
    angles = np.linspace(0.0, 1.2, 25)  # a left turn about (1.5, 4.5), radius 1.5
    arc = np.column_stack([1.5 + 1.5 * np.sin(angles), 4.5 - 1.5 * np.cos(angles), np.zeros(25)])
    heading = (math.cos(1.2), math.sin(1.2), 0)
    result, motion = run(BackUpRecovery, plain(), tuple(arc[-1]), heading, track=arc, distance=1.5, along_track=True)
    assert result.success, result.message
    assert np.linalg.norm(np.asarray(motion.current.position) - arc[4]) < 0.15
    off_the_arc = np.hypot(motion.current.x - 1.5, motion.current.y - 4.5) - 1.5
    assert abs(off_the_arc) < 0.06


def test_backing_up_is_straight_unless_the_track_is_asked_for(run, plain):
    track = [(3.0 - 0.1 * step, 3.0 - 0.05 * step, 0.0) for step in range(10, 0, -1)]
    result, motion = run(BackUpRecovery, plain(), track=track, distance=0.6)
    assert result.success and motion.current.y == pytest.approx(3.0, abs=1e-6)


def test_a_track_that_does_not_lie_behind_is_ignored(run, plain):
    ahead = [(3.0 + 0.1 * step, 3.0, 0.0) for step in range(10, 0, -1)]
    result, motion = run(BackUpRecovery, plain(), track=ahead, distance=0.6, along_track=True)
    assert result.success and motion.current.x == pytest.approx(2.4, abs=0.05)


def test_on_a_slope_too_steep_to_turn_on_a_curved_track_is_backed_up_straight(run):
    """A tilted robot has to get away; as long as it follows its track in wide curves it does so."""
    ramp = MeshMap.from_heights(np.tile(0.6 * np.arange(31) * 0.2, (31, 1)), 0.2, 0.2)
    bend = [(3.0 - 0.1 * step, 3.0 + 0.02 * step**2, 0.6 * (3.0 - 0.1 * step)) for step in range(10, 0, -1)]
    result, motion = run(
        BackUpRecovery, ramp, (3.0, 3.0, 1.8), track=bend, distance=0.5, along_track=True, yaw_rate=1.5
    )
    assert result.success, result.message
    assert motion.current.x < 2.65


@pytest.mark.parametrize("ground", ["border", "lethal"])
def test_backing_up_stops_before_a_border_and_before_lethal_ground(run, plain, paint, ground):
    mesh_map = plain()
    if ground == "lethal":
        paint(mesh_map, lambda v: np.where(v[:, 0] < 2.05, np.inf, 0.0))
    start, reason = (0.9, "the surface ends") if ground == "border" else (2.9, "an obstacle is in the way")
    result, motion = run(BackUpRecovery, mesh_map, (start, 3.0, 0.0), distance=2.0)
    assert result.outcome == RecoveryOutcome.IMPASSABLE and reason in result.message
    assert 0.3 < start - motion.current.x < 0.75


def test_rotating_turns_once_around_on_level_ground_but_not_on_a_slope(run, plain, pose_on):
    result, motion = run(RotateRecovery, plain())
    assert result.success
    assert motion.clock.time == pytest.approx(2 * math.pi / 0.8, abs=0.5)
    ramp = MeshMap.from_heights(np.tile(0.6 * np.arange(31) * 0.2, (31, 1)), 0.2, 0.2)
    result, motion = run(RotateRecovery, ramp, (3.0, 3.0, 1.8), (0, 1, 0))
    assert result.outcome == RecoveryOutcome.IMPASSABLE and "slopes 0.54" in result.message
    assert all(command == Twist() for command in motion.commands)


def test_clearing_layers_frees_what_was_sensed(run, plain, paint, monkeypatch):
    mesh_map = paint(plain(), lambda v: np.where(v[:, 0] > 5, np.inf, 0.0))
    layer = mesh_map.layers["painted"]
    result, _ = run(ClearRecovery, mesh_map, layers=("painted",))
    assert result.success and result.message.startswith("cleared nothing"), "no sensor fills it"
    emptied = np.zeros_like(layer.costs), np.zeros_like(layer.lethal)
    monkeypatch.setattr(type(layer), "clear", lambda self: self.replace(*emptied))
    result, _ = run(ClearRecovery, mesh_map, layers=("painted",))
    assert result.success and result.message == "cleared painted"
    assert not mesh_map.snapshot().lethal.any()
    assert layer.update_from_inputs(NOTHING_CHANGED) is NOTHING_CHANGED


def test_relaxed_inflation_comes_back_by_itself(run, plain, paint, make_plugin):
    mesh_map = paint(plain(), lambda v: np.where(v[:, 0] > 5, np.inf, 0.0))
    source = mesh_map.layers["painted"]
    radii = InflationLayer.Parameters(inscribed_radius=0.5, inflation_radius=1.0)
    inflation = InflationLayer(LayerContext("inflation", mesh_map.topology, mesh_map.locator, radii, (source,)))
    inflation.recompute()
    mesh_map.set_layers(LayerGraph([source, inflation]), "inflation")
    usual = mesh_map.snapshot().costs
    for _ in range(2):  # the second run relaxes the usual radii again, not the relaxed ones
        result, _ = run(RelaxRecovery, mesh_map, inflation_factor=0.5, duration=20.0)
        assert result.success and "inflation at 0.5 m" in result.message
    relaxed = mesh_map.snapshot().costs
    assert np.count_nonzero(relaxed) < np.count_nonzero(usual)
    mesh_map.update(None, 19.9)
    np.testing.assert_array_equal(mesh_map.snapshot().costs, relaxed)
    mesh_map.update(None, 20.0)
    np.testing.assert_array_equal(mesh_map.snapshot().costs, usual)


@ESCAPES
def test_escaping_leaves_a_lethal_disc_by_the_shortest_way(run, plain, paint, escape):
    mesh_map = paint(plain(spacing=0.1), lambda v: np.where(np.hypot(v[:, 0] - 3, v[:, 1] - 3) < 0.8, np.inf, 0.0))
    result, motion = run(escape, mesh_map, (2.6, 3.0, 0.0), (1, 0, 0))
    assert result.success, result.message
    assert motion.current.x < 2.25
    result, motion = run(escape, mesh_map, tuple(motion.current.position))
    assert result.success and "safe surface" in result.message
    result, _ = run(escape, mesh_map, (2.6, 3.0, 0.0), max_distance=0.2)
    assert result.outcome == RecoveryOutcome.IMPASSABLE


@ESCAPES
@pytest.mark.parametrize("gap", [True, False], ids=["way round", "no way"])
def test_escaping_does_not_drive_into_what_appears_on_its_way(run, plain, paint, escape, gap):
    mesh_map = plain(spacing=0.1)
    costly = np.where(np.hypot(*(mesh_map.vertices[:, :2] - 3.0).T) < 1.2, 0.95, 0.0).astype(np.float32)
    paint(mesh_map, lambda v: costly)
    x, y = mesh_map.vertices[:, 0], mesh_map.vertices[:, 1]
    wall = (np.abs(x - 4.1) < 0.11) & (np.abs(y - 3.0) < 0.55) if gap else np.abs(np.hypot(x - 3.7, y - 3) - 0.45) < 0.1

    class AppearingWall(SimulatedMotion):
        def sleep(self, seconds):
            if len(self.commands) == 3:
                costs = np.where(wall, np.inf, costly).astype(np.float32)
                self.mesh_map.apply(lambda layer: layer.replace(costs, np.isinf(costs)))
            spot = self.mesh_map.locate_one(self.current.position)
            assert not self.mesh_map.snapshot().lethal[self.mesh_map.faces[spot.face]].all()
            return super().sleep(seconds)

    result, motion = run(escape, mesh_map, (3.7, 3.0, 0.0), motion_class=AppearingWall, max_distance=3.0)
    assert result.outcome == (RecoveryOutcome.SUCCESS if gap else RecoveryOutcome.IMPASSABLE), result.message
    assert (np.hypot(motion.current.x - 3.0, motion.current.y - 3.0) > 1.1) == gap
    assert gap or np.hypot(motion.current.x - 3.7, motion.current.y - 3.0) < 0.4


@ESCAPES
def test_escaping_ends_where_it_is_safe_even_if_the_end_of_the_way_becomes_forbidden_meanwhile(
    run, plain, paint, escape
):
    mesh_map = plain(spacing=0.1)
    around = np.hypot(*(mesh_map.vertices[:, :2] - 3.0).T)
    paint(mesh_map, lambda v: np.where(around < 0.8, 0.95, 0.0))

    class SpreadingInflation(SimulatedMotion):
        def sleep(self, seconds):
            if len(self.commands) == 3:
                costs = np.where(around < 1.5, 0.95, 0.0).astype(np.float32)
                self.mesh_map.apply(lambda layer: layer.replace(costs, np.zeros(len(costs), dtype=np.bool_)))
            return super().sleep(seconds)

    result, motion = run(escape, mesh_map, (3.5, 3.0, 0.0), motion_class=SpreadingInflation)
    assert result.success, result.message
    assert np.hypot(motion.current.x - 3.0, motion.current.y - 3.0) > 1.5


@ESCAPES
def test_a_robot_beside_a_thin_wall_does_not_escape_through_it(run, plain, paint, escape):
    def wall_with_a_wide_forbidden_band(v):
        corridor = np.where((v[:, 0] > 1.55) & (v[:, 0] < 3.25), 0.95, 0.0)
        return np.where(np.abs(v[:, 0] - 3.0) < 0.05, np.inf, corridor)

    mesh_map = paint(plain(spacing=0.1), wall_with_a_wide_forbidden_band)
    result, motion = run(escape, mesh_map, (2.93, 3.03, 0.0), (-1, 0, 0))
    assert result.success, result.message
    assert motion.current.x < 1.65


@ESCAPES
def test_a_robot_whose_frame_is_above_the_ground_ends_its_escape_at_safe_ground(run, plain, paint, escape):
    mesh_map = paint(plain(spacing=0.1), lambda v: np.where(np.hypot(v[:, 0] - 3, v[:, 1] - 3) < 0.8, np.inf, 0.0))

    class HighFrame(SimulatedMotion):
        def pose(self):
            return replace(self.current, position=(self.current.x, self.current.y, self.current.z + 0.4))

    result, motion = run(escape, mesh_map, (2.6, 3.0, 0.0), motion_class=HighFrame)
    assert result.success, result.message
    assert 1.9 < motion.current.x < 2.25


def test_a_car_escapes_in_curves_it_can_drive_and_a_robot_on_a_steep_slope_does_not_turn(run, plain, paint):
    mesh_map = paint(plain(spacing=0.1), lambda v: np.where(np.hypot(v[:, 0] - 3, v[:, 1] - 3) < 0.8, np.inf, 0.0))
    for mesh_map.max_turning_slope, escape in ((0.35, CarEscape), (-1.0, EscapeRecovery)):
        result, motion = run(escape, mesh_map, (3.4, 3.0, 0.0), (0, 1, 0))
        assert result.success, result.message
        assert all(abs(command.wz) * 0.4 <= abs(command.vx) for command in motion.commands)
    result, motion = run(EscapeRecovery, mesh_map, (3.4, 3.0, 0.0), (0, 1, 0), max_distance=0.2)
    assert (result.outcome, result.message) == (
        RecoveryOutcome.IMPASSABLE,
        "no safe surface within 0.2 m along the surface",
    )


def test_where_no_curve_leads_off_a_steep_slope_a_robot_that_can_turn_takes_the_path(run, plain, paint):
    def narrow(v):
        return np.where(v[:, 0] > 2.45, 0.0, np.where(np.abs(v[:, 1] - 3.0) < 0.11, 0.95, np.inf))

    mesh_map = paint(plain(spacing=0.1), narrow)
    mesh_map.max_turning_slope = -1.0
    car, _ = run(CarEscape, mesh_map, (1.6, 3.0, 0.0), (0, 1, 0))
    assert car.outcome == RecoveryOutcome.IMPASSABLE and "by a manoeuvre" in car.message
    result, motion = run(EscapeRecovery, mesh_map, (1.6, 3.0, 0.0), (0, 1, 0))
    assert result.success and motion.current.x > 2.4, result.message
