"""Where a server for Foxglove listens, and for whom; the server itself is found by an entry point.

A package that can show a robot live offers a function by an entry point of the group ``mbf.live_apps``, named
``foxglove``, see ``terrain.viewer.foxglove.robot.serve_robot``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any

from mbf_abstract.access.page_access import LOOPBACK, PageAccess, Role, is_loopback
from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.session import NavigationSession

LIVE_APPS_GROUP, FOXGLOVE = "mbf.live_apps", "foxglove"
APP = "https://app.foxglove.dev"
PORTS_TRIED = 20
MAX_MESSAGE = 1_000_000  # bytes of a client's message


@dataclass(frozen=True)
class FoxgloveOptions:
    """Options of a server.

    Attributes
    ----------
    host : str
        Interface to listen at.
    port : int
        The first one tried; the next free one is taken. 0 takes any.
    token : bool
        Put a token into the address, so that only those who know it have access.
    read_only : bool
        Watching only; else there are two addresses, one to steer and one to watch.
    origins : tuple of str
        Origins of web pages that may connect, beside Foxglove's own app.

    Raises
    ------
    ValueError
        No token on an interface that other machines can reach.
    """

    host: str = LOOPBACK
    port: int = 8765
    token: bool = True
    read_only: bool = False
    origins: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.token and not is_loopback(self.host):
            raise ValueError(f"without a token Foxglove is served at loopback only, not at {self.host!r}")

    def server_options(self) -> ServerOptions:
        """Return the options of the server, with new tokens each time."""
        access = (PageAccess.by_token if self.token else PageAccess.open)(self.host, self.read_only)
        return ServerOptions(access, self.port, (APP, *self.origins), MAX_MESSAGE, ports=PORTS_TRIED)


def parsed_address(text: str) -> tuple[str, int]:
    """Return host and port of ``HOST:PORT``, ``HOST`` or ``:PORT``; raises ValueError where the port is none."""
    host, colon, port = text.rpartition(":")
    if not colon or text.endswith("]"):
        host, port = text, str(FoxgloveOptions.port)
    if not port.isdecimal() or int(port) > 65535:
        raise ValueError(f"--foxglove-at {text}: expected HOST:PORT with a port from 0 to 65535")
    return host.strip("[]") or LOOPBACK, int(port)


def report_addresses(options: ServerOptions, port: int, note: Callable[[str], None], title: str = "Foxglove") -> None:
    """Say where the app connects to, and what its user should know."""
    access = options.access
    addresses = {role: (access.address(port, role) or "").replace("http", "ws", 1) for role in Role}
    note(f"{title}: open connection, Foxglove WebSocket, {addresses[Role.STEER] or addresses[Role.WATCH]}")
    if addresses[Role.STEER] and addresses[Role.WATCH]:
        note(f"for those who may only watch: {addresses[Role.WATCH]}")
    if not is_loopback(access.host):
        drives = "can drive the robot" if addresses[Role.STEER] else "sees all of it"
        note(
            f"warning: other machines can reach {access.host}, and nothing is encrypted; who has or overhears the "
            f"address {drives}"
        )


@contextmanager
def live_robot(
    options: FoxgloveOptions | None,
    session: NavigationSession,
    send: Callable[[Any], Any],
    name: str,
    note: Callable[[str], None],
) -> Iterator[object]:
    """Serve a robot live inside a block, if that is wanted; at its end the robot is stopped before the server.

    Parameters
    ----------
    options : FoxgloveOptions, optional
        None serves nothing.
    session : NavigationSession
        Its navigator is there, its clock one of real time.
    send : callable
        Takes goals of move_base; raises ValueError where none are taken.
    name : str
        Of the robot.
    note : callable
        Takes what the user should know.

    Raises
    ------
    ValueError
        A package is missing.
    """
    if options is None:
        yield None
        return
    points = list(entry_points(group=LIVE_APPS_GROUP, name=FOXGLOVE))
    if not points:
        raise ValueError("--foxglove: no package that serves robots live is installed")
    try:
        serve: Callable[..., AbstractContextManager[object]] = points[0].load()
    except ImportError as error:
        raise ValueError(f"--foxglove needs more packages: pip install 'mbf-flex[foxglove]' ({error})") from error
    with serve(session, send, options, name, note) as served:
        try:
            yield served
        finally:  # clients that are slow to go must not let it drive on
            server, reason = session.navigator.server, "the program ends"
            server.runtime.gate.close(reason)
            server.cancel_all(reason)
