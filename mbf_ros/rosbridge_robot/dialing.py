"""Opening a WebSocket to the rosbridge of a robot, and what to say when that fails."""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import Any, Protocol
from urllib.parse import urlsplit

from mbf_abstract.event_values import error_text
from mbf_ros.rosbridge_robot.options import LinkOptions

SERVER_HINT = "is the robot's server running (ros2 launch rosbridge_server rosbridge_websocket_launch.xml)?"
MAX_UNSENT = 1000
"""Time [ms] for which sent bytes may stay unacknowledged; what is older is never delivered. Where the system has it."""


class LinkError(ValueError):
    """A connection cannot be opened; the text says why."""


class Socket(Protocol):
    """What is used of a WebSocket."""

    def send(self, message: str | bytes, /) -> None:
        """Send a text frame; may wait."""

    def recv(self) -> str | bytes:
        """Wait for the next frame; raises ConnectionClosed."""

    def close(self) -> None:
        """End the connection, once what was sent has arrived."""


def shown(address: str) -> str:
    """Return an address without its path, which may be a token."""
    parts = urlsplit(address)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}"


def check_address(address: str) -> None:
    """Raise LinkError where an address cannot be one of a rosbridge."""
    try:
        parts = urlsplit(address)
        good = parts.scheme in ("ws", "wss") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        good = False
    if not good:
        raise LinkError(f"expected the address of a rosbridge such as ws://robot:9090, got {address!r}")


def dial(address: str, options: LinkOptions) -> Socket:
    """Open a WebSocket; raises LinkError."""
    try:
        from websockets.exceptions import InvalidHandshake, InvalidStatus
        from websockets.sync.client import connect
    except ImportError as error:
        raise LinkError(f"rosbridge needs websockets: pip install 'mbf-flex[bridge]' ({error})") from error
    failed = f"cannot connect to {shown(address)}: "
    try:
        opened = connect(
            address,
            compression=None,
            proxy=None,
            open_timeout=options.open_timeout,
            close_timeout=1.0,
            ping_interval=options.ping_period,
            ping_timeout=options.ping_period,
            max_size=options.max_message,
        )
    except ConnectionRefusedError as error:
        raise LinkError(f"{failed}nothing listens there; {SERVER_HINT}") from error
    except socket.gaierror as error:
        raise LinkError(f"{failed}the name of the robot is not known ({error.strerror})") from error
    except TimeoutError as error:
        raise LinkError(f"{failed}no answer within {options.open_timeout:g} s; {SERVER_HINT}") from error
    except InvalidStatus as error:
        raise LinkError(failed + _of_status(error.response)) from error
    except (InvalidHandshake, EOFError) as error:
        raise LinkError(f"{failed}what answers there is no WebSocket ({error})") from error
    except Exception as error:  # of the system, of TLS, or of a server that hangs up during the handshake
        raise LinkError(f"{failed}{error_text(error) or type(error).__name__}") from error
    _bound_unsent(opened)
    return opened


def _of_status(response: Any) -> str:
    """What a server means that answers a request for a WebSocket with another HTTP status."""
    code = response.status_code
    body = (response.body or b"").decode("utf-8", "replace").strip()[:200]
    said = f"HTTP {code}" + (f": {body}" if body else "")
    if code in (401, 403):
        return f"access is refused ({said}); put the token in the address or give --secret-file"
    return f"there is no rosbridge at this path ({said})" if code == 404 else f"the server answers {said}"


def _bound_unsent(opened: Any) -> None:
    """Let the connection fail rather than deliver commands late that the network has held back."""
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        with suppress(OSError):  # it is closed already, and whoever reads will see that
            opened.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, MAX_UNSENT)
