"""Recorded tracks of actors: their shapes, and their poses at every sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class ActorTrack:
    """One person, door or other robot.

    Attributes
    ----------
    thing : str
        ``person``, ``door`` or ``robot``.
    vertices, faces : (V, 3) float64, (F, 3) int32
        Its surface in its own frame [m].
    poses : (n, 7) float64
        x y z qx qy qz qw of that frame in the map at each sample of the recording.
    """

    thing: str
    vertices: FloatArray
    faces: NDArray[np.int32]
    poses: FloatArray


def track_arrays(tracks: list[ActorTrack]) -> dict[str, Any]:
    """All tracks as arrays for a file."""
    arrays: dict[str, Any] = {"actor_things": np.array([track.thing for track in tracks], dtype=np.str_)}
    for number, track in enumerate(tracks):
        for name in ("vertices", "faces", "poses"):
            arrays[f"actor_{number}_{name}"] = getattr(track, name)
    return arrays


def tracks_from(arrays: dict[str, Any]) -> list[ActorTrack]:
    """Read what ``track_arrays`` made; older recordings may have none."""
    return [
        ActorTrack(str(thing), *(arrays[f"actor_{number}_{name}"] for name in ("vertices", "faces", "poses")))
        for number, thing in enumerate(arrays.get("actor_things", ()))
    ]
