"""The operation ``auth``, as the package rosauth has it: a client proves that it knows the token, and does not send it.

The code is ``SHA512(token + client + dest + rand + t + level + end)`` in hexadecimal digits, with the times ``t`` and
``end`` [s since 1970] as whole numbers. It holds for a few seconds about ``t``, until ``end``, and once.
"""

from __future__ import annotations

import hashlib
import hmac
from collections import deque
from collections.abc import Callable, Mapping

from mbf_abstract.access.page_access import Role
from mbf_ros.rosbridge.protocol import Operation, OperationError, frame, number_in, text_in

MAX_SKEW = 5  # s between the clocks of client and server
MAX_TIME = 2**53
REMEMBERED = 1000
VALIDITY = 60  # s; of what a client proves


class Authentication:
    """Checks codes.

    Parameters
    ----------
    roles : mapping of str to Role
        What each token allows.
    now : callable
        Seconds since 1970.
    """

    def __init__(self, roles: Mapping[str, Role], now: Callable[[], float]) -> None:
        self._roles = roles
        self._now = now
        self._used: deque[str] = deque(maxlen=REMEMBERED)

    def role(self, operation: Operation) -> Role:
        """Return what the client may do; raises OperationError where its code is wrong, too old or used."""
        code = text_in(operation, "mac").lower()
        start, end = (number_in(operation, name, MAX_TIME) for name in ("t", "end"))
        texts = [text_in(operation, name, "") for name in ("client", "dest", "rand")]
        said = "".join([*texts, str(start), text_in(operation, "level", ""), str(end)])
        for token, role in self._roles.items():
            if hmac.compare_digest(hashlib.sha512((token + said).encode()).hexdigest(), code):
                if abs(self._now() - start) > MAX_SKEW or self._now() > end or code in self._used:
                    break
                self._used.append(code)
                return role
        raise OperationError("auth: the code is wrong, too old, or was used before")


def auth_frame(secret: str, now: Callable[[], float], rand: Callable[[], str]) -> str:
    """Return the operation ``auth`` of a client, which proves that it knows a secret.

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
