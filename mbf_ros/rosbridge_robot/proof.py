"""The operation ``auth`` of a client, which proves that it knows a secret; see ``rosbridge.authentication``."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

from mbf_ros.rosbridge.protocol import frame

VALIDITY = 60  # s


def auth_frame(secret: str, now: Callable[[], float], rand: Callable[[], str]) -> str:
    """Return the operation.

    Parameters
    ----------
    now : callable
        Seconds since 1970.
    rand : callable
        Makes a text that was never used before.
    """
    start = int(now())
    said = {"client": "mbf", "dest": "robot", "rand": rand(), "t": start, "level": "user", "end": start + VALIDITY}
    code = hashlib.sha512(f"{secret}{''.join(map(str, said.values()))}".encode()).hexdigest()
    return frame("auth", mac=code, **said)
