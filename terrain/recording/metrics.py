"""The numbers of a run (``metrics.json``), from its recording alone: distances, speeds, tilt, counts of calls.

Everything is measured on the robot's true poses, not on the estimated ones.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import arcsin, arctan2, norm
from terrain.recording.clearance import clearances
from terrain.recording.planning_times import PlanningTimes
from terrain.recording.recording import Recording

STANDING_SPEED = 0.02  # m/s; slower counts as standing
STANDING_YAW_RATE = 0.05  # rad/s


@dataclass(frozen=True)
class Metrics:
    """The numbers of one run.

    Attributes
    ----------
    time_s : float
        Simulated length of the run.
    path_length_m : float
        Length of the driven track, in 3D.
    planned_length_m : float
        Length of the plans in 3D, each counted as far as it was followed: to where the next one begins, the last one to
        its end.
    mean_speed : float
        Track length by time [m/s].
    climb_m : float
        Sum of all rises along the track.
    max_tilt_deg, max_roll_deg, max_pitch_deg : float
        Largest magnitudes.
    distance_to_goal_m : float or None
        From the last pose to the last goal, None without a goal.
    mean_cross_track_error_m, max_cross_track_error_m : float or None
        Horizontal distance from the track to the plan that was followed at the time, None without a plan.
    stops : int
        How often the robot came to a standstill after it had moved.
    plans, planner_calls, control_cycles, failed_control_cycles, recoveries : int
        Plans accepted, calls of planners and of controllers, those of the latter that gave no valid command, and
        recovery runs, as the event log has them.
    gate_stops, faults : int
        Stops made by the velocity gate and not by a plugin; plugin faults.
    clearance_min_m, clearance_median_m : float or None
        Distance of the robot's outline from the nearest wall, obstacle, person, door or other robot, as seen from
        above; None where there is none.
    planning_time_median_s, planning_time_p95_s : float or None
        Time of the run's clock that planners took; in simulated time a call takes none, its wall time is in
        ``timing.json``.
    mean_command_acceleration, mean_command_yaw_acceleration : float
        Control effort: mean magnitude of the change of the commanded speed [m/s^2] and yaw rate [rad/s^2], from one
        sample to the next.
    """

    scenario: str
    backend: str
    time_s: float
    path_length_m: float
    planned_length_m: float
    mean_speed: float
    climb_m: float
    max_tilt_deg: float
    max_roll_deg: float
    max_pitch_deg: float
    distance_to_goal_m: float | None
    mean_cross_track_error_m: float | None
    max_cross_track_error_m: float | None
    stops: int
    plans: int
    planner_calls: int
    control_cycles: int
    failed_control_cycles: int
    recoveries: int
    gate_stops: int
    faults: int
    clearance_min_m: float | None
    clearance_median_m: float | None
    planning_time_median_s: float | None
    planning_time_p95_s: float | None
    mean_command_acceleration: float
    mean_command_yaw_acceleration: float

    def to_json(self) -> dict[str, Any]:
        """Return plain values, numbers rounded to micrometres and microdegrees."""
        return {key: round(value, 6) if isinstance(value, float) else value for key, value in asdict(self).items()}


def measure(recording: Recording) -> Metrics:
    """Compute all metrics of a run."""
    steps = np.diff(recording.poses[:, :3], axis=0)
    length = float(norm(steps).sum())
    roll, pitch = roll_and_pitch(recording.poses[:, 3:])
    errors = cross_track_errors(recording)
    errors = errors[np.isfinite(errors)]
    events = recording.events
    planning = planning_times(events)
    kept = clearances(recording)
    kept = kept[np.isfinite(kept)]
    return Metrics(
        scenario=recording.scenario,
        backend=recording.backend,
        time_s=recording.duration,
        path_length_m=length,
        planned_length_m=followed_length([path for _, path in recording.paths]),
        mean_speed=length / recording.duration if recording.duration > 0.0 else 0.0,
        climb_m=float(np.maximum(steps[:, 2], 0.0).sum()),
        max_tilt_deg=_largest_degrees(recording.tilt),
        max_roll_deg=_largest_degrees(roll),
        max_pitch_deg=_largest_degrees(pitch),
        distance_to_goal_m=_distance_to_goal(recording),
        mean_cross_track_error_m=float(errors.mean()) if errors.size else None,
        max_cross_track_error_m=float(errors.max()) if errors.size else None,
        stops=count_stops(recording.twists),
        plans=_count(events, EventKind.PLAN),
        planner_calls=_calls(events, "make_plan"),
        control_cycles=_cycles(events, "cycles"),
        failed_control_cycles=_cycles(events, "failed"),
        recoveries=_count(events, EventKind.RECOVERY),
        gate_stops=sum(e.kind is EventKind.ROBOT_STOPPED and e.source == "velocity_gate" for e in events),
        faults=_count(events, EventKind.FAULT),
        clearance_min_m=float(kept.min()) if kept.size else None,
        clearance_median_m=float(np.median(kept)) if kept.size else None,
        planning_time_median_s=float(np.percentile(planning, 50.0)) if planning else None,
        planning_time_p95_s=float(np.percentile(planning, 95.0)) if planning else None,
        mean_command_acceleration=mean_change(recording.times, recording.commands[:, 0]),
        mean_command_yaw_acceleration=mean_change(recording.times, recording.commands[:, 2]),
    )


def roll_and_pitch(orientations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Roll and pitch (n,) [rad] of quaternions (n, 4) x y z w, fixed axes as in REP-103."""
    x, y, z, w = orientations.T
    roll = arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return np.asarray(roll), np.asarray(arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)))


def count_stops(twists: FloatArray) -> int:
    """How often motion (n, 3) ends: changes from moving to standing, the last one at the goal included."""
    moving = (np.hypot(twists[:, 0], twists[:, 1]) > STANDING_SPEED) | (np.abs(twists[:, 2]) > STANDING_YAW_RATE)
    return int(np.count_nonzero(moving[:-1] & ~moving[1:]))


def mean_change(times: FloatArray, values: FloatArray) -> float:
    """Mean magnitude of the change per second of ``values`` (n,) sampled at ``times`` (n,) [s]."""
    passed = np.diff(times)
    changes = np.abs(np.diff(values))[passed > 0.0] / passed[passed > 0.0]
    return float(changes.mean()) if changes.size else 0.0


def planning_times(events: tuple[Event, ...]) -> list[float]:
    """How long [s] each call of a planner took that has ended, by the events' clock."""
    planning = PlanningTimes(lambda event: event.time)
    for event in events:
        planning.write(event)
    return planning.seconds


def followed_length(plans: list[FloatArray]) -> float:
    """Length [m] of plans (m, 3), each to where the next one begins, the last one to its end."""
    plans = [plan for plan in plans if len(plan)]
    lengths = [_length_until(plan, following[0]) for plan, following in pairwise(plans)]
    return sum(lengths) + (_length(plans[-1]) if plans else 0.0)


def _length_until(line: FloatArray, point: FloatArray) -> float:
    """Length [m] of a polyline (m, 3) up to its place nearest to a point (3,)."""
    starts, pieces = line[:-1], np.diff(line, axis=0)
    if len(pieces) == 0:
        return 0.0
    lengths = norm(pieces)
    share = np.clip(np.sum((point - starts) * pieces, axis=1) / np.maximum(lengths**2, 1e-12), 0.0, 1.0)
    nearest = int(np.argmin(norm(starts + share[:, None] * pieces - point)))
    return float(lengths[:nearest].sum() + share[nearest] * lengths[nearest])


def cross_track_errors(recording: Recording) -> FloatArray:
    """(n,) horizontal distance [m] from each pose to the plan of its time; nan before the first plan."""
    errors = np.full(len(recording.times), np.nan)
    begins = np.array([stamp for stamp, _ in recording.paths])
    newest = np.searchsorted(begins, recording.times, side="right") - 1  # -1: no plan yet
    for index, (_, path) in enumerate(recording.paths):
        current = newest == index
        if len(path):
            errors[current] = _distances_to_polyline(recording.poses[current, :2], path[:, :2])
    return errors


def _distances_to_polyline(points: FloatArray, line: FloatArray) -> FloatArray:
    """Distance (n,) of each point (n, 2) to the nearest piece of a polyline (m, 2)."""
    if len(line) == 1:
        return np.asarray(norm(points - line[0]))
    (x, y), (dx, dy) = line[:-1].T.copy(), np.diff(line, axis=0).T.copy()
    squared = np.maximum(dx * dx + dy * dy, 1e-12)
    least = np.empty(len(points))
    for index, (px, py) in enumerate(points.tolist()):  # n x m at once would need gigabytes on long runs
        along = np.minimum(np.maximum(((px - x) * dx + (py - y) * dy) / squared, 0.0), 1.0)
        off_x, off_y = x + along * dx - px, y + along * dy - py
        least[index] = (off_x * off_x + off_y * off_y).min()
    return np.sqrt(least)


def _length(points: FloatArray) -> float:
    return float(norm(np.diff(points, axis=0)).sum())


def _largest_degrees(angles: FloatArray) -> float:
    return math.degrees(float(np.abs(angles).max(initial=0.0)))


def _distance_to_goal(recording: Recording) -> float | None:
    if not recording.goals or not len(recording.poses):
        return None
    return float(norm(recording.poses[-1, :3] - recording.goals[-1].position))


def _count(events: tuple[Event, ...], kind: EventKind) -> int:
    return sum(event.kind is kind for event in events)


def _calls(events: tuple[Event, ...], method: str) -> int:
    return sum(e.kind is EventKind.PLUGIN_CALL_STARTED and e.data.get("method") == method for e in events)


def _cycles(events: tuple[Event, ...], which: str) -> int:
    counts = [event.data.get(which) for event in events if event.kind is EventKind.CONTROL_LOOP]
    return sum(count for count in counts if isinstance(count, int))
