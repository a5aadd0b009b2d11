"""Refiner `dense_poses`: more poses on the lines of a path; nothing else of it changes, so it runs on every map.

When to use: behind a planner whose poses are farther apart than a controller looks. When not: its lines have corners to
be rounded, or leave the ground between two poses.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Path
from mbf_abstract.maps.refiners.map_refiner import MapRefiner
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.time.cancel import CancelToken


class DensePosesParameters(PluginParameters):
    """Parameters of `dense_poses`."""

    spacing: float = parameter(0.1, "Greatest distance of two poses.", unit="m", ge=0.001, le=10.0)


class DensePoses(MapRefiner):
    """Adds poses between those that are far apart; each looks as the pose before it does."""

    Parameters = DensePosesParameters
    parameters: DensePosesParameters
    forward_only = False  # a pose looks the same where the robot drives backward

    def refine(self, path: Path, cancel_token: CancelToken) -> Path:
        """Cut each line between two poses into equal pieces; a longer computation would ask the token now and then."""
        steps = np.diff(path.positions, axis=0)
        pieces = np.maximum(np.ceil(np.linalg.norm(steps, axis=1) / self.parameters.spacing), 1.0).astype(int)
        line = np.append(np.repeat(np.arange(len(steps)), pieces), len(steps))
        share = np.concatenate([*(np.arange(count) / count for count in pieces), [0.0]])
        points = path.positions[line] + share[:, None] * np.append(steps, [[0.0, 0.0, 0.0]], axis=0)[line]
        assert path.orientations is not None
        return Path(points, path.orientations[line], path.frame_id, path.stamp, path.guidance)
