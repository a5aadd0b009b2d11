"""Messages written as JSON, for clients of rosbridge."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_ros.messages.records import Records

PIECE = 10_000  # numbers that are written at a time


def json_text(value: Any) -> str:
    """Return a message as JSON: bytes in base64, and null for numbers that are not finite.

    Long lists are written piece by piece: the encoder of the library would keep all other threads waiting, the control
    loop's too, for the tenths of a second that a mesh takes.
    """
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{json.dumps(str(key))}:{json_text(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list | tuple | Records):
        return "[" + ",".join(map(json_text, value)) + "]"
    if isinstance(value, np.ndarray):
        if value.dtype == np.uint8:
            return json.dumps(base64.b64encode(np.ascontiguousarray(value).tobytes()).decode("ascii"))
        pieces = (value[i : i + PIECE] for i in range(0, len(value), PIECE))
        return "[" + ",".join(json.dumps(_finite(piece), separators=(",", ":"))[1:-1] for piece in pieces) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return "null"
    return json.dumps(value, allow_nan=False)


def _finite(array: NDArray[Any]) -> list[Any]:
    """The numbers of an array, with None for those that are not finite."""
    if array.dtype.kind != "f" or np.isfinite(array).all():
        return array.tolist()  # type: ignore[no-any-return]
    return [number if math.isfinite(number) else None for number in array.tolist()]
