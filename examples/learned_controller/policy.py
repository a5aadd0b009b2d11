"""A policy of 39 numbers, and the controller that drives with it.

    PYTHONPATH=examples/learned_controller mbf bench indoor --controller policy:LearnedController

Speed and yaw rate are weighted sums of features of the scan, the plan ahead and the velocity. What is mirrored at the
robot's axis turns it the other way at the same speed, which halves the numbers to learn.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain.learning.command_range import CommandRange
from terrain.learning.observation import Observation, ObservationParameters
from terrain.learning.policy_controller import PolicyController

OBSERVED = ObservationParameters(scan_sectors=24, scan_range=2.0, waypoints=4, waypoint_spacing=0.25)
COMMANDS = CommandRange(max_vel_x=0.5, min_vel_x=-0.5, max_vel_theta=1.57)
SPEED_WEIGHTS, TURN_WEIGHTS = 22, 17
SIZE = SPEED_WEIGHTS + TURN_WEIGHTS
WEIGHTS = Path(__file__).with_name("weights.json")


def start() -> NDArray[np.float64]:
    """Weights (39,) with which a training begins: steer to the point 0.5 m ahead, and slow down where it lies aside."""
    weights = np.zeros(SIZE)
    weights[0], weights[6] = 0.8, -1.0
    weights[SPEED_WEIGHTS + 1] = 2.0
    return weights


def read_weights() -> list[float]:
    """Return the weights (39,) beside this file, which ``train.py`` has written."""
    return [float(weight) for weight in json.loads(WEIGHTS.read_text())]


def features(seen: Observation) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what does not change in a mirror (22,), and what changes its sign (17,)."""
    closeness = np.square(1.0 - seen["scan"].astype(np.float64) / OBSERVED.scan_range)
    right, left = closeness[:12], closeness[:11:-1]  # sectors count from straight behind, over the right side
    ahead, aside = seen["waypoints"].astype(np.float64).T
    speed, _, turning = seen["velocity"].astype(np.float64).tolist()
    return (
        np.concatenate([[1.0], ahead, np.abs(aside), left + right, [speed]]),
        np.concatenate([aside, left - right, [turning]]),
    )


def action(weights: Sequence[float] | NDArray[np.float64], seen: Observation) -> list[float]:
    """Return speed and yaw rate, from -1 to 1, for weights (39,)."""
    even, odd = features(seen)
    numbers = np.asarray(weights, dtype=np.float64)
    speed = sum((numbers[:SPEED_WEIGHTS] * even).tolist())
    turn = sum((numbers[SPEED_WEIGHTS:] * odd).tolist())
    return [max(-1.0, min(speed, 1.0)), max(-1.0, min(turn, 1.0))]


class LearnedController(PolicyController):
    """Drives with the weights that ``train.py`` has found."""

    observation = OBSERVED
    commands = COMMANDS

    def __init__(self, context: Any) -> None:
        super().__init__(context)
        self._weights = read_weights()

    def act(self, observation: Observation) -> list[float]:
        """Return the action of the policy."""
        return action(self._weights, observation)
