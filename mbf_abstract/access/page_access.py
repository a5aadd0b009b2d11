"""Access to a page or a WebSocket, to watch or to steer, by the address, the ``Host`` and the ``Origin`` of a request.

A browser lets any web page open a WebSocket to this machine, so it is not enough to listen at loopback. Three things
are checked before a request is answered:

- the path of the address begins with a token, known only to those who were given the address, and allows a ``Role``;
- ``Host`` names this machine; another name is a foreign domain that was made to point here (DNS rebinding);
- ``Origin`` of a WebSocket is the page itself, not one that another site served.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from urllib.parse import urlsplit

LOOPBACK = "127.0.0.1"
TOKEN_BYTES = 16
MAX_PATH = 4096  # characters


class Role(Enum):
    """What a visitor may do."""

    STEER = "steer"
    WATCH = "watch"


@dataclass(frozen=True)
class PageAccess:
    """The addresses of a page and what each of them allows.

    Attributes
    ----------
    host : str
        Interface the page listens at.
    roles : mapping of str to Role
        Token, the first part of an address's path -> role; the token ``""`` needs none. Without any, all are refused.
    """

    host: str = LOOPBACK
    roles: Mapping[str, Role] = field(default_factory=dict)

    @classmethod
    def by_token(cls, host: str = LOOPBACK, read_only: bool = False) -> PageAccess:
        """Make a new token for those who may steer, unless ``read_only``, and one for those who may only watch."""
        roles = (Role.WATCH,) if read_only else (Role.STEER, Role.WATCH)
        return cls(host, {secrets.token_urlsafe(TOKEN_BYTES): role for role in roles})

    @classmethod
    def open(cls, host: str = LOOPBACK, read_only: bool = False) -> PageAccess:
        """Let everybody in who can reach a loopback interface.

        Raises
        ------
        ValueError
            The interface is not loopback: it needs a token.
        """
        if not is_loopback(host):
            raise ValueError(f"a page at {host!r}, which is not loopback, needs a token in its address")
        return cls(host, {"": Role.WATCH if read_only else Role.STEER})

    def address(self, port: int, role: Role) -> str | None:
        """Return the address for a role, None where there is none."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        token = next((token for token, allowed in self.roles.items() if allowed is role), None)
        if token is None:
            return None
        return f"http://{host}:{port}/{token}/" if token else f"http://{host}:{port}/"

    def role_and_path(self, path: str) -> tuple[Role, str] | None:
        """Return what a request's path allows, and the path without its token; None for a wrong token."""
        if len(path) > MAX_PATH:
            return None
        first, _, rest = path.partition("?")[0].removeprefix("/").partition("/")
        for token, role in self.roles.items():
            if not token:
                return role, path
            if hmac.compare_digest(token.encode(), first.encode(errors="replace")):
                return role, f"/{rest}"
        return None

    def knows_host(self, host: str) -> bool:
        """Whether a ``Host`` header names this machine, whatever the port, which may be forwarded."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name in ("localhost", self.host.strip("[]").lower()):
            return True
        if is_loopback(self.host):
            return is_loopback(name)
        return _is_address(name) or name in (socket.gethostname().lower(), f"{socket.gethostname().lower()}.local")

    @staticmethod
    def is_same_site(origin: str, host: str) -> bool:
        """Whether an ``Origin`` header is that of a page which the given ``Host`` served."""
        return origin.lower() in (f"http://{host}".lower(), f"https://{host}".lower())


NOBODY = PageAccess()


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an interface."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host.strip("[]")).is_loopback)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True
