"""The server behind a page: started on an interface and the next free port, stopped at the end, and silent."""

from __future__ import annotations

import io
import socket
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

from mbf_abstract.access.page_access import NOBODY, PageAccess
from terrain.viewer.pictures.picture import ViewerMissing
from terrain.viewer.server.page_guard import PageGuard
from terrain.viewer.server.visitor_channel import VisitorChannel


@contextmanager
def page_server(
    port: int, access: PageAccess = NOBODY, label: str | None = None, channel: VisitorChannel | None = None
) -> Iterator[Any]:
    """Start a viser server that is open only to visitors whom ``access`` admits, and stop it afterwards.

    With a ``channel`` its script runs in the page of every visitor.

    Raises
    ------
    ViewerMissing
        viser is not installed or cannot listen there.
    """
    try:
        import viser
    except ImportError as error:
        raise ViewerMissing(f"a page of a run needs viser: pip install 'mbf-flex[sim]' ({error})") from error
    _check_interface(access.host)
    guard = PageGuard(access, channel)
    try:
        with redirect_stdout(io.StringIO()), guard.installed():  # viser's banner is not for those who asked for JSON
            server = viser.ViserServer(host=access.host, port=port, label=label, verbose=False)
    except (OSError, RuntimeError) as error:
        raise ViewerMissing(f"viser cannot start a server on this machine: {error}") from error
    try:
        if not guard.is_installed:
            raise ViewerMissing(f"viser {viser.__version__} cannot be run behind access control, so it is not used")
        guard.controls = server.gui._gui_input_handle_from_uuid
        if channel is not None:
            channel.attach(server)
        yield server
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()


def _check_interface(host: str) -> None:
    """Raise where nothing can listen on an interface; viser would try one port after the other without end."""
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with socket.create_server((host, 0), family=family):
            pass
    except OSError as error:
        reason = (error.strerror or str(error)).partition(" (while")[0]  # without the address, which Python repeats
        raise ViewerMissing(f"cannot listen at {host!r}, which is no interface of this machine: {reason}") from error
