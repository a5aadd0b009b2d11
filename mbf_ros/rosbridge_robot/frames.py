"""Frames of a robot's rosbridge: JSON as text, or CBOR as bytes, in which lists of numbers are typed arrays (RFC 8746).

CBOR keeps what JSON cannot say: the infinite range of a ray that met nothing, which comes as null in JSON.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from mbf_ros.rosbridge.protocol import Operation, OperationError
from mbf_ros.rosbridge_robot.dialing import LinkError

TYPED_ARRAYS = {
    **{64: "u1", 65: ">u2", 66: ">u4", 67: ">u8", 68: "u1", 69: "<u2", 70: "<u4", 71: "<u8"},
    **{72: "i1", 73: ">i2", 74: ">i4", 75: ">i8", 77: "<i2", 78: "<i4", 79: "<i8"},
    **{80: ">f2", 81: ">f4", 82: ">f8", 84: "<f2", 85: "<f4", 86: "<f8"},
}
"""Kind of the numbers by the tag of a typed array."""


def cbor_decoder() -> Callable[[bytes], Any]:
    """Return what decodes CBOR; raises LinkError where the package for it is missing."""
    try:
        from cbor2 import CBORTag, loads
    except ImportError as error:
        raise LinkError(f"rosbridge needs cbor2: pip install 'mbf-flex[bridge]' ({error})") from error

    def plain(value: Any) -> Any:
        """A value with arrays for its typed arrays; the hook of cbor2 for tags differs by version."""
        if isinstance(value, dict):
            return {key: plain(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [plain(inner) for inner in value]
        return _array(value) if isinstance(value, CBORTag) else value

    return lambda data: plain(loads(data))


def _array(tagged: Any) -> Any:
    """The numbers of a typed array; raises ValueError where the tag is another."""
    if tagged.tag not in TYPED_ARRAYS:
        raise ValueError(f"the tag {tagged.tag} of CBOR is not known")
    array = np.frombuffer(tagged.value, TYPED_ARRAYS[tagged.tag])
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def operation_of(frame: str | bytes, decode_cbor: Callable[[bytes], Any]) -> Operation:
    """Return the operation in a frame; raises OperationError where it is none."""
    try:
        found = json.loads(frame) if isinstance(frame, str) else decode_cbor(frame)
    except Exception as error:  # the decoders raise many kinds
        kind = "JSON" if isinstance(frame, str) else "CBOR"
        raise OperationError(f"expected a frame of {kind}: {error}") from error
    if not isinstance(found, dict) or not isinstance(found.get("op"), str):
        raise OperationError('expected an object with a text "op"')
    return found
